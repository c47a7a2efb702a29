"""Air density by which ArduPilot compensates the thrust: three formulas, each by its version and board."""

import numpy as np
import pytest

from quadctl.thrust_chain.atmosphere import (
    Air,
    Atmosphere,
    Version,
    air_density_ratio,
    atmosphere_of,
    standard_density_ratio,
    takes_standard,
    version_in,
    version_of_number,
)

WARM = Air(pressure_pa=95597.6, ground_temperature_c=28.33, height_m=3.0, altitude_m=491.1)
"""Air of a recorded flight of Copter 4.7 in SITL."""


@pytest.mark.parametrize(
    ("atmosphere", "ratio"),
    # 95597.6 / (287.26 (301.48 - 0.0195)) / 1.225 and 95597.6 / (287.26 (301.48 - 3.192)) / 1.225, by hand
    [
        (Atmosphere.GROUND, 0.90116),
        (Atmosphere.ASSUMED, 0.90116),
        (Atmosphere.SEA_LEVEL, 0.91075),
        (Atmosphere.STANDARD, 0.95369),
    ],
)
def test_each_formula_gives_its_own_density(atmosphere: Atmosphere, ratio: float) -> None:
    assert air_density_ratio(WARM, atmosphere) == pytest.approx(ratio, abs=2e-5)


@pytest.mark.parametrize(
    ("altitude_m", "density"), [(-1000.0, 1.3470), (1000.0, 1.1117), (3000.0, 0.90925), (8000.0, 0.52579)]
)
def test_the_standard_atmosphere_is_that_of_its_tables(altitude_m: float, density: float) -> None:
    """U.S. Standard Atmosphere 1976, table I, geometric altitude."""
    assert 1.225 * standard_density_ratio(altitude_m) == pytest.approx(density, rel=2e-4)


@pytest.mark.parametrize(
    ("version", "is_standard", "atmosphere"),
    [
        ((3, 6), True, Atmosphere.GROUND),
        ((4, 5), True, Atmosphere.GROUND),
        ((4, 6), True, Atmosphere.STANDARD),
        ((4, 6), False, Atmosphere.SEA_LEVEL),
        ((5, 0), True, Atmosphere.STANDARD),
        (None, True, Atmosphere.ASSUMED),
    ],
)
def test_the_version_tells_the_formula(version: Version | None, is_standard: bool, atmosphere: Atmosphere) -> None:
    assert atmosphere_of(version, is_standard) is atmosphere


def logged(kelvin: float, span_m: float) -> Air:
    """Pressures of a climb, and the heights that a firmware makes of them with this temperature at the ground."""
    pressure_pa = np.linspace(95000.0, 95000.0 - 11.8 * span_m, 50)
    height_m = 153.8462 * kelvin * (1.0 - np.exp(0.190259 * np.log(pressure_pa / 95000.0)))
    return Air(pressure_pa, np.full(50, 28.33), height_m, np.full(50, np.nan))


@pytest.mark.parametrize(
    ("kelvin", "span_m", "standard"),
    # 284.7 K: the standard temperature at 95 kPa; 301.48 K: 28.33 °C
    [(284.65, 3.0, True), (301.48, 3.0, False), (301.48, 0.2, True)],
    ids=["standard", "ground temperature", "too little height to tell"],
)
def test_the_barometric_height_tells_which_atmosphere_the_board_takes(
    kelvin: float, span_m: float, standard: bool
) -> None:
    assert takes_standard(logged(kelvin, span_m)) is standard


def test_versions_are_read_from_texts_and_numbers() -> None:
    assert version_in("ArduCopter V4.7.0-dev (d0cf3149)") == (4, 7)
    assert version_in("APM:Copter V3.3.3 (acf2e10b)") == (3, 3)
    assert version_in("ChibiOS: 88b84600") is None
    assert version_of_number(0x04060102) == (4, 6)
    assert version_of_number(0) is None
