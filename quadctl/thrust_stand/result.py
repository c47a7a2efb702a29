"""Result of a measurement on the stand: lines for the terminal, numbers for scripts, values for the vehicle file."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from enum import unique
from typing import Any

from quadctl.thrust_stand.curves import (
    Alternative,
    Estimate,
    ThrottleLine,
    ThrustCurve,
    fit_throttle_line,
    fit_thrust_curve,
)
from quadctl.thrust_stand.measurement import Point, check_points
from quadctl.vehicle import Vehicle
from quadctl.words import Fact, Kinds, When, Words, fact, plain

SAG = 0.03
"""Share of the voltage; thrust at a throttle goes about with its square."""


def _with_interval(estimate: Estimate) -> str:
    low, high = estimate.ci95
    return f"{estimate.value:.4g} [{low:.4g}, {high:.4g}]"


def _law(alternative: Alternative) -> str:
    value, (low, high) = alternative.parameter.value, alternative.parameter.ci95
    if alternative.law == "power":
        return f"T ~ rpm^{value:.2f} [{low:.2f}, {high:.2f}]"
    return f"T = k rpm^2 {value:+.2g} N [{low:.2g}, {high:.2g}]"


def _test(alternative: Alternative) -> str:
    return f"F(1, {alternative.parameter.freedom}) = {alternative.f_ratio:.3g}, p = {alternative.p_value:.2g}"


_WORDS = Words({"estimate": _with_interval, "law": _law, "test": _test})


@unique
class Kind(Kinds, words=_WORDS):
    """Kinds of findings, each with the template of its words."""

    NO_SPEEDS = "No rotor speeds: rotor.thrust_n_per_rpm2 is not fitted and stays as it is."
    COEFFICIENT = (
        "T = k rpm^2: k = {k:estimate} N/rpm^2, vehicle file {was:.4g} ({change:+.1%}); {rms_n:.3g} N rms left"
    )
    NOT_TESTED = "Whether one k is enough cannot be tested with fewer than four points."
    ENOUGH = "One k is enough: {best:law} would change {best.worst_n:.2g} N at most ({best:test})."
    NOT_ENOUGH = (
        "One k is not enough: {better:law} fits better ({better:test}); k alone is off by up to {better.worst_n:.2g} N "
        "({share:.0%} of the greatest), at {better.at_rpm:.0f} rpm."
    )
    SCALE_OFF = "An offset is a scale that was not at zero, or a mount that carries load: measure again."
    POWER = (
        "The vehicle file gets k = {better.k_hover:.4g}, right in hover; a model that holds elsewhere adds "
        "thrust_curve.power with exponent {better.parameter.value:.2f}."
    )
    LINE = (
        "throttle = offset + per_newton * total thrust: offset = {line.offset:estimate} (vehicle file "
        "{was.offset:.4g}), per_newton = {line.per_newton:estimate} (vehicle file {was.per_newton:.4g})"
    )
    POINTS = (
        "from {line.n_points} points at throttle {line.from_throttle:.2f} to {line.to_throttle:.2f}, the worst "
        "{line.worst:.3f} off the line; hover at {hover:.3f}"
    )
    GREATEST = (
        "greatest thrust of a rotor: {newtons:.3g} N (",
        When("measured", "measured", "of the line, full throttle was not measured"),
        ")",
    )
    SAG = "The voltage went from {from_v:.2f} to {to_v:.2f} V: the throttle line holds for a battery that sags alike."


@dataclass(frozen=True)
class StandResult:
    """The fits to the points of one rotor of `vehicle`."""

    points: Sequence[Point]
    vehicle: Vehicle
    thrust: ThrustCurve | None
    """None where there are no rotor speeds."""
    throttle: ThrottleLine

    def vehicle_values(self) -> dict[tuple[str, ...], float]:
        """New values of the vehicle file, by its keys."""
        values: dict[tuple[str, ...], float] = {
            ("throttle", "per_newton"): self.throttle.per_newton.value,
            ("throttle", "offset"): self.throttle.offset.value,
            ("throttle", "max_thrust_per_rotor_n"): self.throttle.max_thrust_per_rotor_n,
        }
        if self.thrust is not None:
            values["rotor", "thrust_n_per_rpm2"] = self.thrust.k_to_fly
        return values

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        thrust, line = self.thrust, self.throttle
        told = {
            "points": [point._asdict() for point in self.points],
            "thrust_n_per_rpm2": None if thrust is None else _numbers(thrust.k),
            "one_k_is_enough": None if thrust is None or not thrust.alternatives else thrust.better is None,
            "alternatives": [] if thrust is None else [asdict(a) for a in thrust.alternatives],
            "throttle": {
                "per_newton": _numbers(line.per_newton),
                "offset": _numbers(line.offset),
                "max_thrust_per_rotor_n": line.max_thrust_per_rotor_n,
            },
            "vehicle": {".".join(keys): value for keys, value in self.vehicle_values().items()},
        }
        found: dict[str, Any] = plain(told)
        return found

    def findings(self) -> list[Fact]:
        """Findings in the order in which they are told."""
        return [*self._thrust(), *self._throttle(), *self._voltage()]

    def _thrust(self) -> list[Fact]:
        curve = self.thrust
        if curve is None:
            return [Fact(Kind.NO_SPEEDS)]
        was = self.vehicle.rotor.thrust_n_per_rpm2
        found = [fact(Kind.COEFFICIENT, k=curve.k, was=was, change=curve.k.value / was - 1.0, rms_n=curve.rms_n)]
        if not curve.alternatives:
            return [*found, Fact(Kind.NOT_TESTED)]
        if curve.better is None:
            return [*found, fact(Kind.ENOUGH, best=curve.alternatives[0])]
        better = curve.better
        advice = Fact(Kind.SCALE_OFF) if better.law == "offset" else fact(Kind.POWER, better=better)
        return [*found, fact(Kind.NOT_ENOUGH, better=better, share=better.worst_n / curve.greatest_n), advice]

    def _throttle(self) -> list[Fact]:
        line = self.throttle
        hover = line.offset.value + line.per_newton.value * self.vehicle.weight_n
        return [
            fact(Kind.LINE, line=line, was=self.vehicle.throttle),
            fact(Kind.POINTS, line=line, hover=hover),
            fact(Kind.GREATEST, newtons=line.max_thrust_per_rotor_n, measured=line.reached_full),
        ]

    def _voltage(self) -> list[Fact]:
        volts = [point.voltage_v for point in self.points if math.isfinite(point.voltage_v)]
        if not volts or min(volts) > (1.0 - SAG) * max(volts):
            return []
        return [fact(Kind.SAG, from_v=max(volts), to_v=min(volts))]


def evaluate(points: Sequence[Point], vehicle: Vehicle, source: str) -> StandResult:
    """Fit the points of one rotor; `source` names them in error messages.

    Raises
    ------
    LogError
        These cannot be measurements of one of the vehicle's rotors, or are too few.
    """
    check_points(points, vehicle, source)
    return StandResult(points, vehicle, fit_thrust_curve(points, vehicle), fit_throttle_line(points, vehicle))


def _numbers(estimate: Estimate) -> dict[str, Any]:
    return {"value": estimate.value, "standard_error": estimate.standard_error, "ci95": estimate.ci95}
