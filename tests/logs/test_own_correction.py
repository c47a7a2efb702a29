"""A firmware that corrects for ground effect by itself is seen from its outputs over the command, and said."""

import numpy as np
import pytest

from quadctl.logs.own_correction import correction_findings, own_correction
from quadctl.logs.quality import quality
from quadctl.logs.read import read_log
from tests.support.places import DATA

REAL = DATA / "real"
pytestmark = pytest.mark.skipif(not REAL.is_dir(), reason="the recordings of real autopilots are not here")


@pytest.mark.parametrize("kind", ["csv", "bin"])
def test_the_recorded_correction_is_found_with_its_size(kind: str) -> None:
    """The recorded firmware divides its outputs by 1.117, 1.075, 1.053 and 1.020 at 0.1, 0.2, 0.3 and 0.6 m."""
    log = read_log(REAL / "ardupilot" / f"hover_staircase.{kind}")
    found = own_correction(log)
    at = np.interp([0.11, 0.2, 0.3, 0.6], [f.height_m for f in found], [f.ratio for f in found])
    assert at == pytest.approx([1 / 1.117, 1 / 1.075, 1 / 1.053, 1 / 1.020], abs=0.015)
    assert any("corrects its outputs near the ground by itself" in note for note in quality(log).notes)


@pytest.mark.parametrize("name", ["px4/vertical_runs.csv", "px4/figure8_on_the_ground.csv", "px4/vertical_runs.ulg"])
def test_an_autopilot_that_corrects_nothing_is_not_accused(name: str) -> None:
    assert correction_findings(read_log(REAL / name)) == []
