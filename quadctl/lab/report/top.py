"""Headline of a report: the main number and the verdict."""

from quadctl.lab.comparison.failures import most_telling
from quadctl.lab.comparison.reservations import on_condition, reservations
from quadctl.lab.comparison.wording import (
    FLOOR,
    change_in_words,
    failure_in_words,
    flights_in_words,
    held_out,
    listed,
    number,
    percent,
    plain,
    quantity,
    roughly,
)
from quadctl.lab.fitting.bootstrap import drop_interval
from quadctl.lab.report.numbers import (
    floor_total,
    rmse_interval,
    total,
    unseen_before,
    unseen_floor,
    unseen_residuals,
)
from quadctl.lab.report.parts import Headline, Tile
from quadctl.lab.report.results import Results
from quadctl.lab.tracking.step_response import first_and_last
from quadctl.lab.words import in_words


def headline(r: Results) -> Headline:
    before, after, what = _main_number(r)
    vehicle, dataset = r.comparison.model.vehicle, r.comparison.dataset
    said = (*r.shown.said, *_added(r)) if r.shown.said else (*_verdict(r), *_what_is_left(r))
    condition = r.shown.condition
    if condition is None and any(flight.weight_doubt for flight in dataset.flights):
        condition = vehicle
    if not r.shown.said:  # the page has said it already
        said = (on_condition(said[0], condition), *said[1:])
    change = "" if after is None else change_in_words(1.0 - after / before)
    return Headline(
        before=number(before),
        after="" if after is None else number(after),
        change=change,
        what=what,
        sentences=[*said, *reservations(vehicle, dataset)],
        tiles=_tiles(r),
    )


def _main_number(r: Results) -> tuple[float, float | None, str]:
    """Error before and after, and the data that it refers to: as on the page; else unseen flights come first, then
    held-out data."""
    if r.shown.errors_m_s2 is not None:
        return *r.shown.errors_m_s2, r.shown.where
    if r.after is not None:
        flights = flights_in_words(r.after.dataset.names)
        return unseen_before(r)["total"], r.after.rmse["total"], f"on {flights}, which no fit has seen"
    if r.diagnosis is not None and len(r.diagnosis.steps) > 1:
        steps = r.diagnosis.steps
        return steps[0].rmse["total"], steps[-1].rmse["total"], f"on {held_out(r.diagnosis.dataset)}"
    if r.addition is not None:
        a = r.addition
        return a.before["total"], a.after["total"], f"on {held_out(a.dataset)}"
    return r.comparison.rmse["total"], None, f"on {flights_in_words(r.comparison.dataset.names)}"


def _added(r: Results) -> list[str]:
    """Sentence on the effects by which the last model differs from the first."""
    if r.addition is None:
        return []
    first = {effect.name for effect in r.comparison.model.effects}
    new = [plain(effect.family()) for effect in r.addition.model.effects if effect.name not in first]
    return [f"Added to {r.comparison.model.name}: {listed(new)}."] if new else []


def _verdict(r: Results) -> list[str]:
    name = r.comparison.model.name
    if r.diagnosis is not None:
        return [in_words(r.diagnosis.answer[0])]
    if r.addition is not None:
        added = r.addition.added.name
        if r.addition.conclusion:
            return [f"{added} does not lower the held-out error significantly: leave it out."]
        return [f"{added} lowers the held-out error by {percent(r.addition.held_out_drop)}."]
    if not r.comparison.fails_where:
        return [f"{name} has no significant error in any range of a variable."]
    return [f"{failure_in_words(most_telling(r.comparison.fails_where)[0])}."]


def _what_is_left(r: Results) -> list[str]:
    if r.after is not None:
        old, new = unseen_residuals(r)
        low, high = drop_interval(old, new, r.after.dataset.block)
        floor = unseen_floor(r)
        return [
            f"The error on the unseen data falls by {percent(1.0 - total(new) / total(old))} "
            f"(95% interval {percent(low)} to {percent(high)}).",
            f"The remaining error is {r.after.rmse['total'] / floor:.2f} times the reference error of "
            f"{roughly(floor)}.",
        ]
    floor = floor_total(r)
    if r.diagnosis is not None and r.diagnosis.verdict == "missing":
        left = r.diagnosis.steps[-1].rmse["total"]
        if left < floor:
            return [
                f"With these effects, the remaining error is {quantity(left)}, below the reference error of "
                f"{roughly(floor)}."
            ]
        return [
            f"With these effects, the remaining error is {left / floor:.2f} times the reference error of "
            f"{roughly(floor)}."
        ]
    low, high = rmse_interval(r.comparison.residual, r.comparison.dataset)
    return [
        f"The acceleration error of the model is {quantity(r.comparison.rmse['total'])} (95% interval {low:.3g} to "
        f"{high:.3g}); a flexible regression on all logged variables leaves {roughly(floor)}."
    ]


def _tiles(r: Results) -> list[Tile]:
    c = r.comparison
    tiles = [
        Tile(
            roughly(unseen_floor(r) if r.shown.on_unseen or r.after is not None else floor_total(r)),
            f"reference error: {FLOOR}",
        ),
    ]
    if c.explained > 0.0:
        tiles.append(Tile(percent(c.explained), f"of the acceleration's variance is predicted by {c.model.name}"))
    if r.steps is not None and (pair := first_and_last(r.steps)) is not None:
        (_, first), (_, last) = pair
        if first.m_b_absolute and last.m_b_absolute is not None:
            change = change_in_words(1.0 - last.m_b_absolute / first.m_b_absolute)
            tiles.append(
                Tile(
                    change,
                    "M_B (absolute) of the simulated step with the compensator: the difference to one far from ground",
                )
            )
    return tiles
