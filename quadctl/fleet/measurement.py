"""Measurement of one flight: the parameters of the model and the strength of each rotor, by this flight alone."""

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from quadctl.effects.thrust_scale import ConstantScale
from quadctl.errors import QuadctlError
from quadctl.lab.arrays import Floats
from quadctl.lab.fitting.fitted_model import FittedModel, fit_model
from quadctl.lab.fitting.nuisances import MOMENTS, moment_per_load
from quadctl.lab.fitting.parameters import undetermined, values_of
from quadctl.lab.flights.dataset import Dataset, load_dataset
from quadctl.logs.quality import quality
from quadctl.logs.read import read_log
from quadctl.model import Model


@dataclass(frozen=True)
class FlightRecord:
    """Quantities that one flight shows, or the reason why it shows none."""

    vehicle: str
    flight: str
    """Path of the log in the folder of the fleet."""
    key: str = ""
    """Content, model and software that were measured: with another key the flight is measured again."""
    problem: str = ""
    """Reason why the flight could not be measured, one sentence; "" where it was."""
    flight_s: float = 0.0
    thrust_source: str = ""
    error_m_s2: float = 0.0
    """Held-out acceleration error of the model fitted to this flight."""
    values: dict[str, float] = field(default_factory=dict)
    """Each quantity that the flight determines: `FAMILY PARAMETER`, and `rotor N` for the strength of a rotor."""


def measure(vehicle: str, flight: str, key: str, path: Path, model: Model) -> FlightRecord:
    """Measure the flight in `path` with the effects of `model`; a flight that cannot be measured says why.

    No error leaves this function: one damaged log of a thousand must not end the work on the others.
    """
    empty = FlightRecord(vehicle, flight, key)
    try:
        log = read_log(path)
        report = quality(log)
        if not report.can_be_analysed:
            return replace(empty, problem="; ".join(report.obstacles))
        dataset = load_dataset([log], model.vehicle)
        found = fitted_to_flight(with_thrust(model), dataset)
    except QuadctlError as error:
        return replace(empty, problem=str(error))
    except Exception as error:  # a defect of a reader or a fit, which is to be reported with its log
        return replace(empty, problem=f"{path}: failed by a defect of this program ({type(error).__name__}: {error})")
    return replace(
        empty,
        flight_s=report.flight_s,
        thrust_source=report.thrust_source or "",
        error_m_s2=found.held_out_rmse["total"],
        values={**_parameters(found), **_rotors(found)},
    )


def with_thrust(model: Model) -> Model:
    """The model with an effect that holds the mean thrust of a flight, which is what most changes first."""
    if any("thrust" in effect.corrects for effect in model.effects):
        return model
    return model.plus(ConstantScale(1.0))


def fitted_to_flight(model: Model, dataset: Dataset) -> FittedModel:
    """Fit of `model` to one flight; effects that the flight does not determine keep the parameters of `model`."""
    found = fit_model(model, dataset)
    blind = {free.effect for free in undetermined(found.free, found.intervals)}
    if not blind:
        return found
    stack = tuple(replace(item, held=i in blind) for i, item in enumerate(model.stack))
    return fit_model(replace(model, stack=stack), dataset)


def _parameters(found: FittedModel) -> dict[str, float]:
    values = values_of(found.model, found.free)
    effects = found.model.effects
    return {
        f"{effects[free.effect].family()} {free.parameter.name}": float(value)
        for free, value in zip(found.free, values, strict=True)
    }


def _rotors(found: FittedModel) -> dict[str, float]:
    """Strength of each rotor relative to its thrust coefficient in the vehicle file, by thrust and moments together.

    The mean over the rotors is the flight's thrust; the differences are the smallest that make its moments. Of four
    rotors both determine each one.
    """
    scale = [effect for effect in found.model.effects if isinstance(effect, ConstantScale)]
    if "turning" not in found.dataset.groups or not scale:
        return {}
    vehicle, nuisance = found.model.vehicle, found.optimum.nuisances[0]
    mean = scale[0].factor * (1.0 + float(nuisance[0]))
    arms_m = np.array(vehicle.moment_arms_m).T
    wanted_m: Floats = nuisance[MOMENTS] * moment_per_load(vehicle) / (vehicle.weight_n / vehicle.n_rotors)
    apart = np.linalg.pinv(np.vstack([np.ones(vehicle.n_rotors), arms_m])) @ np.array([0.0, *wanted_m])
    return {f"rotor {i}": float(mean + difference) for i, difference in enumerate(apart, start=1)}
