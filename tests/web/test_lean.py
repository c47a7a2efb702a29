"""Imports of the live view: the process that flies loads no web library for it, and its server loads no lab."""

import subprocess
import sys

import pytest

LAB = ("quadctl.lab", "scipy", "polars", "matplotlib", "joblib", "cloudpickle")
PAGES = ("nicegui", "starlette", "fastapi", "uvicorn")


def loaded_by(module: str, libraries: tuple[str, ...]) -> list[str]:
    """Those of `libraries` that a new process holds after importing `module`."""
    code = f"import sys, {module}; print([name for name in {libraries} if name in sys.modules])"
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    return [name for name in libraries if f"'{name}'" in answer]


@pytest.mark.parametrize(
    ("module", "libraries"),
    [
        ("quadctl.web", (*LAB, *PAGES, "numpy")),
        ("quadctl.web.live.viewer", (*LAB, *PAGES)),
        ("quadctl.web.live.history", (*LAB, *PAGES)),
        ("quadctl.web.live.server", LAB),
        ("quadctl.web.work.worker", LAB[:-1]),
    ],
)
def test_what_is_not_needed_is_not_loaded(module: str, libraries: tuple[str, ...]) -> None:
    assert loaded_by(module, libraries) == []


def test_the_lab_page_loads_the_lab() -> None:
    assert loaded_by("quadctl.web.page.server", ("quadctl.lab", "nicegui")) == ["quadctl.lab", "nicegui"]
