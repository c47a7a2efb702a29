"""Missions: a file becomes phases of trajectories within limits; the reference at any time is a pure function of it."""

from quadctl.missions.file import load_mission, mission_files
from quadctl.missions.mission import Mission, MissionLimits, Phase

__all__ = ["Mission", "MissionLimits", "Phase", "load_mission", "mission_files"]
