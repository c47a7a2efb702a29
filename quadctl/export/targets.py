"""The targets of `quadctl export`; a new one is a file and a line here."""

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

from quadctl.export.ardupilot import ARDUPILOT
from quadctl.export.px4 import PX4
from quadctl.model import Model

AUTOPILOTS = {"px4": PX4, "ardupilot": ARDUPILOT}
"""Targets that are parameters of an autopilot, by the word of `--to`."""


def _write_casadi(model: Model, path: Path) -> tuple[str, ...]:
    import casadi as ca  # takes half a second

    from quadctl.export.dynamics import dynamics

    equations = dynamics(model)
    with TemporaryDirectory() as folder:  # CasADi says nothing where it cannot write
        saved = Path(folder) / "body.casadi"
        file = ca.FileSerializer(str(saved))
        file.pack(equations.function)
        file.pack(equations.commanded)
        del file  # closes it
        path.write_bytes(saved.read_bytes())
    return equations.left_out


def _write_numpy(model: Model, path: Path) -> tuple[str, ...]:
    from quadctl.export.equations import actuation, left_out
    from quadctl.export.numpy_code import numpy_code

    path.write_text(numpy_code(model, model.name), encoding="utf-8")
    return left_out(model, actuation(model))


def _write_rotorpy(model: Model, path: Path) -> tuple[str, ...]:
    from quadctl.export.rotorpy import rotorpy_code

    text, left_out = rotorpy_code(model)
    path.write_text(text, encoding="utf-8")
    return left_out


def _write_crazyflow(model: Model, path: Path) -> tuple[str, ...]:
    from quadctl.export.crazyflow import crazyflow_code

    text, left_out = crazyflow_code(model)
    path.write_text(text, encoding="utf-8")
    return left_out


def _write_gazebo(model: Model, path: Path) -> tuple[str, ...]:
    from quadctl.export.gazebo import gazebo_sdf

    text, left_out = gazebo_sdf(model)
    path.write_text(text, encoding="utf-8")
    return left_out


def _write_sih(model: Model, path: Path) -> tuple[str, ...]:
    from quadctl.export.sih import sih_parameters

    text, left_out = sih_parameters(model)
    path.write_text(text, encoding="utf-8")
    return left_out


def _write_sitl(model: Model, path: Path) -> tuple[str, ...]:
    from quadctl.export.sitl_frame import sitl_frame

    text, left_out = sitl_frame(model)
    path.write_text(text, encoding="utf-8")
    return left_out


PROGRAMS: dict[str, Callable[[Model, Path], tuple[str, ...]]] = {
    "casadi": _write_casadi,
    "numpy": _write_numpy,
    "rotorpy": _write_rotorpy,
    "crazyflow": _write_crazyflow,
    "gazebo": _write_gazebo,
    "sih": _write_sih,
    "sitl": _write_sitl,
}
"""Targets that are equations of motion, or a simulator's parameters, each with the function that writes a model into a
file; it returns what of the model the file leaves out."""
