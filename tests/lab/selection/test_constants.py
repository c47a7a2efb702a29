"""Specification of a battery sag beside a thrust scale: one finding where the voltage does not tell the two apart."""

import dataclasses

import numpy as np
import pytest

from quadctl.effects.battery_sag import PowerSag
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.lab.flights.dataset import Dataset, load_dataset
from quadctl.lab.selection.diagnosis import Diagnosis, diagnose
from quadctl.logs.columns import rpm_columns
from quadctl.model import Model
from quadctl.vehicle import Vehicle
from tests.support.flights import obedient

POOL = [ConstantScale, PowerSag]
REFERENCE_V = 16.0


def flown(raptor: Vehicle, share: float, factor: float, volts: tuple[float, float], noise_m_s: float) -> Dataset:
    """Flight whose thrust is `factor` (V / 16 V)^share of the file's, while the voltage falls and recovers."""
    log = obedient(Model(raptor), 60.0, noise_m_s=noise_m_s)
    battery_v = np.mean(volts) + 0.5 * (volts[0] - volts[1]) * np.sin(2.0 * np.pi * log.time_s / 15.0)
    ratio = factor * (battery_v / REFERENCE_V) ** share
    rpm = {
        name: values / np.sqrt(ratio) for name, values in log.columns.items() if name in rpm_columns(raptor.n_rotors)
    }
    return load_dataset([dataclasses.replace(log, columns={**log.columns, **rpm, "battery_v": battery_v})], raptor)


def diagnosed(raptor: Vehicle, dataset: Dataset) -> Diagnosis:
    return diagnose(Model(raptor), dataset, POOL)


@pytest.mark.parametrize("share", [0.0, 1.8])
def test_over_a_narrow_range_of_voltages_the_answer_is_a_thrust_scale(raptor: Vehicle, share: float) -> None:
    factor = (14.5 / REFERENCE_V) ** (1.8 - share)
    found = diagnosed(raptor, flown(raptor, share, factor, (14.56, 14.44), 1.0))
    assert found.missing == ["thrust_scale"]
    assert ["thrust_scale", "battery_sag"] in found.confounded


def test_a_sag_that_the_voltage_shows_stays(raptor: Vehicle) -> None:
    found = diagnosed(raptor, flown(raptor, 1.8, 1.0, (16.4, 13.6), 0.01))
    assert found.missing == ["battery_sag"]


def test_both_are_named_where_the_voltage_shows_both(raptor: Vehicle) -> None:
    found = diagnosed(raptor, flown(raptor, 1.8, 0.7, (16.4, 13.6), 0.01))
    assert sorted(found.missing) == ["battery_sag", "thrust_scale"]


def test_a_scale_too_large_for_any_sag_of_these_data_is_no_pair(raptor: Vehicle) -> None:
    found = diagnosed(raptor, flown(raptor, 0.0, 0.7, (16.4, 13.6), 0.01))
    assert (found.missing, found.confounded) == (["thrust_scale"], [])
