"""Comparison of a model with flights: its error, the reference error, and the conditions under which it fails."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from quadctl.effects.per_flight import PerFlight
from quadctl.lab.arrays import Floats
from quadctl.lab.comparison.agreement import Agreement, Errors, of_one_model
from quadctl.lab.comparison.failures import (
    LEAST_PART,
    Failure,
    Profile,
    failures,
    followed,
    is_telling,
    profiles,
    told,
    unexplained,
)
from quadctl.lab.comparison.open_loop import OpenLoop, open_loop, open_loop_table
from quadctl.lab.comparison.reservations import reservations
from quadctl.lab.comparison.wording import Said, on_terminal, quantity, roughly
from quadctl.lab.fitting.flexible_regression import flexible_residual, noise_floor
from quadctl.lab.flights.dataset import AlignedDataset, Dataset
from quadctl.lab.flights.prediction import AXES, rmse
from quadctl.lab.results import Result, errors_table
from quadctl.model import Model
from quadctl.words import Fact, count, fact

SHOWN_FAILURES = 6
TOLD_HORIZON_S = 2.0


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(Result):
    """Errors of a model on a dataset; accelerations are kinematic, m/s^2; a residual is measured minus predicted."""

    model: Model
    dataset: AlignedDataset
    residual: Floats
    """Residual acceleration, north, east, up, m/s^2, shape (n, 3)."""
    rmse: dict[str, float]
    noise_floor: dict[str, float]
    """Reference error per axis and total, m/s^2: held-out error of a flexible regression on all logged variables. A
    model of these variables comes close to it, and can be below it."""
    explained: float
    """Share of the acceleration's variance that the model explains (R^2); negative where the model is worse than
    predicting the mean."""
    fails_where: list[Failure]
    profiles: list[Profile]
    open_loop: list[OpenLoop]
    """Open-loop errors, one entry per horizon; empty where no flight is long enough."""
    agreement: Agreement | None
    """Agreement of the flights in the error of the model; None of a single flight."""

    @property
    def telling(self) -> list[Profile]:
        """Profiles that are worth a look, what explains most of the error of all axes first."""
        return [p for p in self.profiles if is_telling(p) and self.share_of_all(p) >= LEAST_PART]

    @property
    def variance(self) -> Fact:
        """The share of the variance that the model explains."""
        return fact(Said.VARIANCE, explained=self.explained, better=self.explained > 0.0)

    def share_of_all(self, profile: Profile) -> float:
        """Share of the squared error of all axes in the means of a profile."""
        square = np.sum(self.residual**2, axis=0)
        return profile.share * float(square[AXES.index(profile.axis)]) / max(float(square.sum()), 1e-12)

    def to_dict(self) -> dict[str, Any]:
        return {
            "model": self.model.name,
            "n_samples": len(self.residual),
            "flights": self.dataset.names,
            "bandwidth_hz": [round(flight.bandwidth_hz, 3) for flight in self.dataset.flights],
            "rmse": self.rmse,
            "noise_floor": self.noise_floor,
            "explained": self.explained,
            "open_loop": [errors.to_dict() for errors in self.open_loop],
            "fails_where": [{**failure.to_dict(), "text": str(failure.said)} for failure in self.fails_where],
            "agreement": None if self.agreement is None else self.agreement.to_dict(),
            "record": self.dataset.record,
            "notes": [
                *(f"{flight.name}: {note}" for flight in self.dataset.flights for note in flight.notes),
                *map(str, values_of_other_flights(self.model, self.dataset.names)),
                *map(str, reservations(self.model.vehicle, self.dataset)),
            ],
        }

    def __rich__(self) -> RenderableType:
        widths = ", ".join(sorted({f"{flight.bandwidth_hz:.1f}" for flight in self.dataset.flights}))
        error, floor = quantity(self.rmse["total"]), roughly(self.noise_floor["total"])
        of = f"Acceleration error of {self.model.name}, per-flight bias not removed"
        lines: list[str | Fact] = [
            f"{of}: {error}; reference error (a regression on all logged variables): {floor}.",
            self.variance,
        ]
        if self.agreement is not None:
            lines.append(self.agreement.said)
        if self.fails_where:
            shown = told(self.fails_where, SHOWN_FAILURES)
            from_average = (
                ", or from the average in brackets" if any(f.said.facts.get("average") for f in shown) else ""
            )
            lines.append(
                "Where the model fails, the largest share of the squared error first (n sigma: the largest mean of the "
                f"line is n standard errors from zero{from_average}):"
            )
            lines += [f"  - {failure.said} ({abs(failure.sigma):.0f} sigma)" for failure in shown]
            if len(self.fails_where) > SHOWN_FAILURES:
                lines.append(
                    f"  - {count(len(self.fails_where) - SHOWN_FAILURES, 'more line')} like these: --json, --html"
                )
            more = (followed(shown, self.dataset), unexplained(self.fails_where, self.rmse))
            lines += [said for said in more if said is not None]
        else:
            lines.append(fact(Said.NO_FAILURE, model="The model"))
        lines += [f"Note: {note}." for note in values_of_other_flights(self.model, self.dataset.names)]
        lines += [f"{said}." for said in reservations(self.model.vehicle, self.dataset)]
        lines += [errors.said for errors in self.open_loop if errors.horizon_s == TOLD_HORIZON_S]
        title = f"On {', '.join(self.dataset.names)}: {len(self.residual)} samples, filtered to {widths} Hz"
        table = errors_table(title, (("error (RMSE)", self.rmse), ("reference error", self.noise_floor)))
        tables = [table, open_loop_table(self.open_loop)] if self.open_loop else [table]
        return Group(Text(on_terminal("\n".join(map(str, lines)))), *tables)


def compare(model: Model, dataset: Dataset) -> Comparison:
    """Evaluate `model` on `dataset` with its present parameters; no parameter is fitted."""
    aligned = dataset.aligned_for(model)
    residual = aligned.residual(model)
    causes = aligned.causes
    noise = noise_floor(residual, flexible_residual(residual, aligned, causes)) if causes else residual
    seen = profiles(residual, noise, aligned)
    return Comparison(
        model=model,
        dataset=aligned,
        residual=residual,
        rmse=rmse(residual),
        noise_floor=floor_on(aligned, residual),
        explained=explained(residual, aligned.measured),
        fails_where=failures(residual, noise, aligned, seen),
        profiles=seen,
        open_loop=open_loop(model, aligned),
        agreement=of_one_model(model, Errors.of(residual, aligned)),
    )


def values_of_other_flights(model: Model, flights: Sequence[str]) -> list[Fact]:
    """Effects that hold values of single flights, by their place in the order given, where these are not
    the flights that they were fitted to, or stand in another order."""
    found = []
    for item in model.stack:
        if not isinstance(item.effect, PerFlight) or item.fitted is None:
            continue
        if not item.effect.numbers and item.effect.values().get("flight", 0.0) < 1.0:
            continue
        logs = list(item.fitted.logs)
        if list(flights) != logs[: len(flights)]:
            found.append(fact(Said.OTHER_FLIGHTS, effect=item.effect.name, logs=logs, flights=flights))
    return found


def floor_on(dataset: Dataset, residual: Floats) -> dict[str, float]:
    """Reference error per axis and total, m/s^2, on `dataset`, from the residual of a model, shape (n, 3)."""
    return rmse(noise_floor(residual, flexible_residual(residual, dataset)))


def explained(residual: Floats, measured: Floats) -> float:
    """Share of the variance that a model explains (R^2), from residual and measured acceleration, shape (n, 3) each."""
    return float(1.0 - np.sum(residual**2) / np.sum((measured - measured.mean(axis=0)) ** 2))
