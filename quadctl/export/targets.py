"""The targets of `quadctl export`; a new one is a file and a line here."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from pkgutil import resolve_name
from tempfile import TemporaryDirectory

from quadctl.export.ardupilot import ARDUPILOT
from quadctl.export.px4 import PX4
from quadctl.model import Model
from quadctl.words import Fact

AUTOPILOTS = {"px4": PX4, "ardupilot": ARDUPILOT}
"""Targets that are parameters of an autopilot, by the word of `--to`."""


def _write_casadi(model: Model, path: Path) -> tuple[Fact, ...]:
    import casadi as ca  # takes half a second

    from quadctl.export.dynamics import dynamics

    equations = dynamics(model)
    with TemporaryDirectory() as folder:  # CasADi says nothing where it cannot write
        saved = Path(folder) / "body.casadi"
        file = ca.FileSerializer(str(saved))
        for function in (equations.function, equations.commanded, equations.disturbed, equations.foreseen):
            if function is not None:
                file.pack(function)
        del file  # closes it
        path.write_bytes(saved.read_bytes())
    return equations.left_out


def _of_text(source: str, model: Model, path: Path) -> tuple[Fact, ...]:
    """Write the text of `source`, `module:function`; that takes a model and returns text and what it leaves out."""
    text, left_out = resolve_name(f"quadctl.export.{source}")(model)
    path.write_text(text, encoding="utf-8")
    return tuple(left_out)


PROGRAMS: dict[str, Callable[[Model, Path], tuple[Fact, ...]]] = {
    "casadi": _write_casadi,
    "numpy": partial(_of_text, "numpy_code:numpy_code"),
    "rotorpy": partial(_of_text, "rotorpy:rotorpy_code"),
    "crazyflow": partial(_of_text, "crazyflow:crazyflow_code"),
    "gazebo": partial(_of_text, "gazebo:gazebo_sdf"),
    "sih": partial(_of_text, "sih:sih_parameters"),
    "sitl": partial(_of_text, "sitl_frame:sitl_frame"),
}
"""Targets that are equations of motion, or a simulator's parameters, each with the function that writes a model into a
file; it returns what of the model the file leaves out."""
