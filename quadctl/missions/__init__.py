"""A mission file to phases of trajectories with limits; the reference at any time is a pure function of the mission."""

from quadctl.missions.file import load_mission, mission_files
from quadctl.missions.mission import Mission, MissionLimits, Phase

__all__ = ["Mission", "MissionLimits", "Phase", "load_mission", "mission_files"]
