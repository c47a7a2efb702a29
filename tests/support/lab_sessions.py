"""Data of the tests of the lab page: a simulated flight, sessions with findings in it, wrong files."""

import fcntl
import shutil
from pathlib import Path

import yaml

from quadctl.effects import CATALOG
from quadctl.flight.preflight.preparation import prepare_flight
from quadctl.lab.study import Study, quiet
from quadctl.model import load_model
from quadctl.sitl.run import simulate
from quadctl.web.session.findings import Findings
from quadctl.web.session.session import Session, Step, load_session, session_to_yaml
from quadctl.web.work.jobs import look_for, open_logs
from quadctl.web.work.reading import read_logs
from tests.support.visitors import ROOT

VEHICLE = ROOT / "config" / "vehicles" / "raptor.yaml"
ADDED = "ground_effect.exponential"
"""Effect that a search finds in that flight."""
EXPRESSION = {
    "parts": ["{a}*exp(-{b}*height_over_radius)", "{c}"],
    "variables": ["height_over_radius"],
    "coefficients": {"a": 2.0, "b": 0.6, "c": -0.05},
    "ci95": {"a": (1.8, 2.2), "b": (0.5, 0.7), "c": (-0.1, 0.0)},
    "bounds": {"a": (-10.0, 10.0), "b": (0.1, 3.0), "c": (-0.3, 0.3)},
    "held_out_share": 0.9,
}
CUSHION = {"effects": [{"effect": "hidden.ground_cushion", "parameters": {"gain": 0.25, "width": 1.8}}]}
STAIRCASE = {
    "name": "short_staircase",
    "phases": [
        {"name": "takeoff", "kind": "move", "to_m": [0, 0, 0.9], "speed_m_s": 0.5},
        {"name": "down", "kind": "staircase", "to_z_m": 0.1, "step_m": 0.1, "hold_s": 3},
        {"name": "up", "kind": "staircase", "to_z_m": 0.9, "step_m": 0.1, "hold_s": 3},
    ],
    "limits": {"min_z_m": 0.08, "max_z_m": 1.2, "max_distance_m": 1.0, "max_duration_s": 120},
}


def fly_over_a_cushion(where: Path, name: str = "flight.csv", seed: int = 1) -> Path:
    """A log of a flight over a ground whose cushion is in no catalogue; the truth is beside it."""
    mission, hidden = where / "short_staircase.yaml", where / "hidden.yaml"
    mission.write_text(yaml.safe_dump(STAIRCASE))
    hidden.write_text(yaml.safe_dump(CUSHION))
    outcome = simulate(
        prepare_flight(mission, ROOT / "config" / "flight_thesis.yaml", "none", None), where, hidden, seed
    )
    return Path(shutil.move(outcome.log, where / name))


def flown_and_searched(shared: Path) -> tuple[Path, str]:
    """The log of such a flight, in a folder that all processes of a test run share, and the text of its session.

    The first to ask flies and searches; the truth is beside the log.
    """
    where = shared / "cushion"
    where.mkdir(parents=True, exist_ok=True)
    log, session = where / "flight.csv", where / "one.lab.yaml"
    with (where / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not session.exists():
            searched(fly_over_a_cushion(where))
    return log, session.read_text(encoding="utf-8")


def searched(log: Path) -> Path:
    """A session with `log` and the rigid body, searched."""
    model = load_model(VEHICLE)
    opened = open_logs(read_logs([log], (), quiet), frozenset(), model.vehicle, "blocks", frozenset(), quiet)
    assert opened.seen is not None
    found = look_for(Study(model, opened.seen), quiet)
    return _saved(Session().with_logs([log]).begun_with(model).searched(model, found), log.with_name("one.lab.yaml"))


def one_step_up(session: Path) -> Path:
    """The same, and one step more: the effect that was found, and nothing left."""
    begun, found = _begun(session)
    assert found.content["missing"] == ["ground_effect"]
    added = begun.sequence[0].model.plus(CATALOG[ADDED].from_values(found.content["best"][0]["parameters"], ""))
    nothing = Findings(
        found.content | {"verdict": "none", "missing": [], "steps": found.content["steps"][:1], "best": []}
    )
    return _saved(begun.extended(Step(f"+ {ADDED}", added, found=nothing)), session.with_name("two.lab.yaml"))


def unexplained(session: Path) -> Path:
    """The same, if the catalogue held no ground effect and an expression had been found."""
    begun, found = _begun(session)
    law = {"axis": "up", "sparse": EXPRESSION, "compact": EXPRESSION, "p_value": 1e-6}
    symbolic = {"frame": "world", "laws": [law], "ranges": {"height_over_radius": (0.8, 7.5)}}
    nothing = {"verdict": "unexplained", "missing": [], "unexplained": True, "steps": found.content["steps"][:1]}
    other = Findings(found.content | nothing | {"symbolic": symbolic})
    return _saved(begun.searched(begun.sequence[0].model, other), session.with_name("unexplained.lab.yaml"))


def _begun(session: Path) -> tuple[Session, Findings]:
    begun = load_session(session)
    found = begun.sequence[0].found
    assert found is not None
    return begun, found


def _saved(session: Session, path: Path) -> Path:
    path.write_text(session_to_yaml(session), encoding="utf-8")
    return path


def wrong_files(where: Path) -> list[tuple[Path, str]]:
    """Files that cannot be used, and what is said of each."""
    garbage, notes, huge = where / "garbage.csv", where / "notes.md", where / "huge.csv"
    garbage.write_text("this,is\nno,log\n")
    notes.write_text("# A file that is no log\n")
    with huge.open("wb") as file:
        file.truncate(2**30)
    elsewhere, effects = where / "elsewhere.yaml", where / "effects.yaml"
    elsewhere.write_text("logs: [/etc/passwd]\nrungs: []\n")
    effects.write_text(f"vehicle: {ROOT}/config/vehicles/raptor.yaml\neffect_files: [/tmp/effect.py]\neffects: []\n")
    return [
        (garbage, "garbage.csv"),
        (notes, "notes.md: is no flight log by its name"),
        (huge, "expected at most"),
        (elsewhere, "/etc/passwd: is outside"),
        (effects, "effect.py: is outside"),
    ]
