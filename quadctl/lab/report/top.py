"""Headline of a report: the main number and the verdict."""

from quadctl.lab.comparison.failures import most_telling
from quadctl.lab.comparison.reservations import reservations
from quadctl.lab.comparison.wording import FLOOR, Said, change_in_words, number, percent, roughly, where
from quadctl.lab.finding import Finding
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
from quadctl.lab.words import Answer, in_words
from quadctl.words import Fact, fact


def headline(r: Results) -> Headline:
    before, after, what = _main_number(r)
    vehicle, dataset = r.comparison.model.vehicle, r.comparison.dataset
    if r.shown.said:  # the page has said it already, on its condition
        said = [*r.shown.said, *_added(r)]
    else:
        doubted = any(flight.weight_doubt for flight in dataset.flights)
        condition = vehicle if r.shown.condition is None and doubted else r.shown.condition
        said = [in_words(_verdict(r), condition), *map(in_words, _what_is_left(r))]
    change = "" if after is None else change_in_words(1.0 - after / before)
    return Headline(
        before=number(before),
        after="" if after is None else number(after),
        change=change,
        what=str(what),
        sentences=[*map(str, said), *(f"{each}." for each in reservations(vehicle, dataset))],
        tiles=_tiles(r),
    )


def _main_number(r: Results) -> tuple[float, float | None, Fact | str]:
    """Error before and after, and the data that it refers to: as on the page; else unseen flights come first, then
    held-out data."""
    if r.shown.errors_m_s2 is not None:
        return *r.shown.errors_m_s2, r.shown.where
    if r.after is not None:
        unseen = fact(Answer.ON_UNSEEN, flights=r.after.dataset.names)
        return unseen_before(r)["total"], r.after.rmse["total"], unseen
    if r.diagnosis is not None and len(r.diagnosis.steps) > 1:
        steps = r.diagnosis.steps
        return steps[0].rmse["total"], steps[-1].rmse["total"], where(r.diagnosis.dataset, ())
    if r.addition is not None:
        a = r.addition
        return a.before["total"], a.after["total"], where(a.dataset, ())
    return r.comparison.rmse["total"], None, fact(Answer.ON_FLIGHTS, flights=r.comparison.dataset.names)


def _added(r: Results) -> list[Fact]:
    """The effects by which the last model differs from the first."""
    if r.addition is None:
        return []
    first = {effect.name for effect in r.comparison.model.effects}
    new = [effect.family() for effect in r.addition.model.effects if effect.name not in first]
    return [fact(Answer.ADDED, model=r.comparison.model.name, families=new)] if new else []


def _verdict(r: Results) -> Finding | Fact:
    if r.diagnosis is not None:
        return r.diagnosis.answer[0]
    if r.addition is not None:
        kind = Answer.LEAVE_OUT if r.addition.conclusion else Answer.LOWERS
        return fact(kind, effect=r.addition.added.name, drop=r.addition.held_out_drop)
    if not r.comparison.fails_where:
        return fact(Said.NO_FAILURE, model=r.comparison.model.name)
    return fact(Said.FAILS, failure=most_telling(r.comparison.fails_where)[0].said)


def _what_is_left(r: Results) -> list[Fact]:
    if r.after is not None:
        old, new = unseen_residuals(r)
        low, high = drop_interval(old, new, r.after.dataset.block)
        floor = unseen_floor(r)
        return [
            fact(Answer.FALLS, drop=1.0 - total(new) / total(old), low=low, high=high),
            fact(Answer.LEFT, times=r.after.rmse["total"] / floor, floor_m_s2=floor),
        ]
    floor = floor_total(r)
    if r.diagnosis is not None and r.diagnosis.verdict == "missing":
        left = r.diagnosis.steps[-1].rmse["total"]
        return [fact(Answer.LEFT_WITH, times=left / floor, floor_m_s2=floor)]
    low, high = rmse_interval(r.comparison.residual, r.comparison.dataset)
    error = r.comparison.rmse["total"]
    return [fact(Answer.ERROR_OF_MODEL, error_m_s2=error, low=low, high=high, floor_m_s2=floor)]


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
