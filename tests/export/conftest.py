"""A flight that no fit has seen, for all targets whose equations can be evaluated here."""

import pytest

from tests.support.held_out import REAL, HeldOut, held_out_flight


@pytest.fixture(scope="session")
def held_out() -> HeldOut:
    if not REAL.is_dir():
        pytest.skip("the logs of real PX4 are not here")
    return held_out_flight()
