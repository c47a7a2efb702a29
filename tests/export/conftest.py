"""A flight that no fit has seen, for all targets whose equations can be evaluated here."""

import importlib.util
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from tests.support.held_out import REAL, HeldOut, held_out_flight


@pytest.fixture(scope="session")
def held_out() -> HeldOut:
    if not REAL.is_dir():
        pytest.skip("the logs of real PX4 are not here")
    return held_out_flight()


@pytest.fixture(scope="session")
def dynamics() -> Iterator[Callable[..., Any]]:
    """The function of drone-models, which asks for SciPy's array API before it is imported."""
    if importlib.util.find_spec("drone_models") is None:
        pytest.skip("drone-models is not installed")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SCIPY_ARRAY_API", "1")
        from drone_models.first_principles import dynamics as function

        yield function
