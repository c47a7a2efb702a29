"""Suggestion of the next flight: every mission is simulated, and rated by what its data would add to those so far.

Optimal design of experiments (Fedorov 1972; for rival models Atkinson & Fedorov 1975, Biometrika 62). The data of a
flight are not known before it, but their information is, to first order: it follows from the Jacobian of the
predictions, the noise of the data so far, and the priors of the nuisances.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import unique
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from quadctl.effects import Effect, every_effect
from quadctl.effects.ground_effect_surfaces import PREFIX, Surfaces
from quadctl.errors import QuadctlError
from quadctl.installed import locate, name_of
from quadctl.lab.arrays import Floats
from quadctl.lab.fitting.fitted_model import FittedModel, fit_model
from quadctl.lab.fitting.initial_guesses import Unmodelled
from quadctl.lab.fitting.noise import CorrelatedNoise, noise_scale
from quadctl.lab.fitting.parameters import free_parameters, values_of
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.flights.flight import Flight
from quadctl.lab.flights.prediction import predict_targets
from quadctl.lab.planning.information import Information, information, prior
from quadctl.lab.planning.planned_flight import planned_flight
from quadctl.lab.results import Result
from quadctl.lab.selection.diagnosis import Diagnosis
from quadctl.lab.selection.trial import fit_on_top
from quadctl.lab.threads import one_blas_thread
from quadctl.missions import Mission, load_mission, mission_files
from quadctl.model import Model
from quadctl.words import Fact, Kinds, fact

ENOUGH_SIGMAS = 15.0
"""Expected distance of confounded effects, in standard deviations, at which they count as separated, with a margin for
unforeseen errors."""
NARROW = 0.1
"""Relative width below which an interval is narrow enough."""
LEAST_VALUE = 0.01
"""Least value of a parameter, as a share of its range, with which the width of its interval is compared."""
EQUAL_GAIN = 0.1
"""Gains that differ by less are equal; a mission whose gains are all smaller is not worth flying."""
SHOWN_OPTIONS = 10
"""Most missions in the table of a suggestion."""
UNKNOWN = 20.0
"""Relative width beyond which an interval is printed as unknown."""


@dataclass(frozen=True, eq=False)
class Option:
    """One mission and its expected gains."""

    mission: Mission
    command: str
    sigmas: list[float]
    """Expected distance of each pair of confounded effects by its data, in standard deviations."""
    width: float | None
    """Expected width of the parameter's 95 % interval, relative to its value."""
    tries: list[str]
    """Effects that could be tried with its data, but not with those so far."""
    gains: tuple[float, float, float]
    """Gain for each open question, from 0 to 1 (fully answered): confounded effects, interval, untried effects."""

    @property
    def tells_more(self) -> bool:
        return max(self.gains) > EQUAL_GAIN

    def to_dict(self) -> dict[str, Any]:
        return {
            "mission": self.mission.name,
            "command": self.command,
            "duration_s": self.mission.duration_s,
            "expected_sigmas": self.sigmas,
            "expected_relative_width": self.width,
            "tries": self.tries,
            "gains": dict(zip(("look_alikes", "interval", "untried"), self.gains, strict=True)),
        }


@unique
class Said(Kinds):
    """Parts of a suggestion, each with its template."""

    DISTINGUISHES = "It tells {one} from {other} by {sigma:.1f} standard deviations."
    IDENTIFIES = "It identifies {parameter}, which these flights do not, to {width}."
    NARROWS = "It is expected to narrow the 95 % interval of {parameter} to {share:.0%} of its width."
    LEFT_OUT = "Not compared: {reason}."
    SURFACE = (
        "The surface that is least known is {surface}; over it: quadctl fly missions/surface_heights.yaml --set "
        "surface={surface}"
    )
    TESTABLE = "It makes these effects testable: {effects:list}."
    FLY = "Fly next: {command}"
    NONE_TELLS_MORE = "No flight is suggested: none of these missions would give more information."
    NO_CANDIDATE = (
        "No flight is suggested: no candidate explains the unexplained part, so the missions cannot be compared."
    )
    NO_QUESTION = "No flight is suggested: no question is open."


@dataclass(frozen=True, eq=False, repr=False)
class Suggestion(Result):
    """Result of `suggest`: the options, the best first."""

    options: list[Option]
    pairs: list[tuple[str, str]]
    """Pairs of families that the data so far cannot distinguish."""
    parameter: str | None
    """Parameter with the widest interval that a flight can narrow."""
    width: float | None
    """Width of its interval by the data so far, relative to its value."""
    untried: list[str]
    """Effects that could not be tried because the data so far could not distinguish them from others."""
    left_out: list[str]
    """Reasons why missions cannot be flown or analysed."""
    unexplained: bool
    """True where something is missing that is no effect of the catalogue; missions cannot be rated by it."""
    surface: str | None = None
    """Surface whose weight in the ground effect is the least known; None without `ground_effect.surfaces`."""

    @property
    def best(self) -> Option | None:
        """Option to fly; None where no mission would tell anything new."""
        return self.options[0] if self.options and self.options[0].tells_more else None

    def to_dict(self) -> dict[str, Any]:
        return {
            "command": self.best.command if self.best else None,
            "options": [option.to_dict() for option in self.options],
            "confounded": [list(pair) for pair in self.pairs],
            "parameter": self.parameter,
            "relative_width": self.width,
            "untried": self.untried,
            "left_out": self.left_out,
            "surface": self.surface,
        }

    def __rich__(self) -> RenderableType:
        telling = [option for option in self.options if option.tells_more]
        shown = (telling or self.options)[:SHOWN_OPTIONS]
        title = f"{len(telling)} of {len(self.options)} missions would tell more; the best, if added to these logs"
        table = Table(title=title, title_justify="left")
        table.add_column("mission", no_wrap=True)
        for one, other in self.pairs:
            table.add_column(f"{one}\nor {other}", justify="right")
        if self.width is not None:
            table.add_column(
                f"{self.parameter}\n(now {_plus_minus(self.width)},\nlinearised)", justify="right", overflow="fold"
            )
        if self.untried:
            table.add_column("untried effects\nit would show", justify="right")
        table.add_column("time, s", justify="right")
        for option in shown:
            row = [option.mission.name, *(f"{sigma:.1f} sigma" for sigma in option.sigmas)]
            row += [_plus_minus(option.width)] if option.width is not None else []
            row += [f"{len(option.tries)} of {len(self.untried)}"] if self.untried else []
            table.add_row(*row, f"{option.mission.duration_s:.0f}")
        first, *others = map(str, self.answer)
        command = Text(first, no_wrap=True, overflow="ignore")  # to be copied
        return Group(command, *([Text("\n".join(others))] if others else []), *([table] if shown else []))

    @property
    def reasons(self) -> list[Fact]:
        """Parameters that the best option is expected to tell; none where no flight is suggested."""
        best = self.best
        if best is None:
            return []
        pairs = zip(self.pairs, best.sigmas, strict=True)
        found = [fact(Said.DISTINGUISHES, one=one, other=other, sigma=sigma) for (one, other), sigma in pairs]
        if self.width is not None and best.width is not None and best.width < self.width:
            kind = Said.IDENTIFIES if self.width >= UNKNOWN else Said.NARROWS
            widths = {"width": _plus_minus(best.width), "share": best.width / self.width}
            found.append(fact(kind, parameter=self.parameter, **widths))
        return found

    @property
    def answer(self) -> list[Fact]:
        """The suggestion, and the missions left out."""
        more = [] if self.surface is None else [fact(Said.SURFACE, surface=self.surface)]
        more += [fact(Said.LEFT_OUT, reason=reason) for reason in self.left_out]
        if self.best is not None:
            tries = [fact(Said.TESTABLE, effects=self.best.tries)] if self.best.tries else []
            return [fact(Said.FLY, command=self.best.command), *tries, *more]
        asked = self.pairs or self.untried or (self.width is not None and self.width > NARROW)
        unknown = Said.NO_CANDIDATE if self.unexplained else Said.NO_QUESTION
        return [fact(Said.NONE_TELLS_MORE if asked else unknown), *more]


@dataclass(frozen=True, eq=False)
class _Form:
    """Model fitted to the data so far, and their information about its parameters."""

    fit: FittedModel
    known: Information

    @property
    def model(self) -> Model:
        return self.fit.model

    def widths(self, more: Information | None = None) -> Floats:
        """Width of the 95 % interval of each free parameter relative to its value, shape (p,), to first order."""
        free = free_parameters(self.model)
        least = np.array([LEAST_VALUE * (f.parameter.high - f.parameter.low) for f in free])
        known = self.known if more is None else self.known + more
        return np.asarray(3.92 * known.standard_errors / np.maximum(np.abs(values_of(self.model, free)), least))


@one_blas_thread
def suggest(diagnosis: Diagnosis, missions: Path | str = Path("missions")) -> Suggestion:
    """Suggest which of the `missions` (YAML files of a folder) best answers what `diagnosis` leaves open.

    There are three kinds of open questions, in the order of their weight: effects that the data do not distinguish,
    a wide interval of a parameter, and effects that could not be tried because the data vary too little.

    Raises
    ------
    SettingsError
        The folder holds no mission.
    """
    dataset, best = diagnosis.dataset, diagnosis.best
    fit = diagnosis.fit or fit_model(best, dataset)
    noise = _noise(dataset.targets - fit.predicted, dataset)
    form = _known(fit, noise, considering=True)
    rivals = _rivals(diagnosis, form, noise)
    tried_not = {finding.facts["effect"] for finding in diagnosis.untried}
    catalogue = every_effect(diagnosis.model.effect_files)
    untried = [effect for name, effect in catalogue.items() if name in tried_not]
    plans, left_out = _plans(locate(Path(missions)), best, dataset)
    groups = dataset.groups
    after = [form.widths(information(best, flight, groups, noise, considering=True)) for _, _, flight in plans]
    asked = _widest(form.widths(), after)
    names = [f"{f.parameter.name} ({best.effects[f.effect].name})" for f in free_parameters(best)]
    width = None if asked is None else float(form.widths()[asked])
    options = []
    for (mission, command, flight), widths in zip(plans, after, strict=True):
        sigmas = [pair.sigmas(flight) for pair in rivals]
        expected = None if asked is None else float(widths[asked])
        tries = [effect.name for effect in untried if _brings(effect, dataset, flight)]
        gains = (_separated(sigmas), _narrowed(width, expected), len(tries) / max(len(untried), 1))
        options.append(Option(mission, command, sigmas, expected, tries, gains))
    return Suggestion(
        options=_ordered(options),
        pairs=[pair.names for pair in rivals],
        parameter=None if asked is None else names[asked],
        width=width,
        untried=[effect.name for effect in untried],
        left_out=left_out,
        unexplained=diagnosis.unexplained,
        surface=least_known_surface(diagnosis.model),
    )


def least_known_surface(model: Model) -> str | None:
    """Surface with the widest interval in the model's file; None where it has no fitted `ground_effect.surfaces`."""
    for item in model.stack:
        if isinstance(item.effect, Surfaces) and item.fitted is not None:
            known = {name: item.fitted.ci95.get(PREFIX + name, (-math.inf, math.inf)) for name in item.effect.surfaces}
            return max(known, key=lambda name: known[name][1] - known[name][0], default=None)
    return None


class _Rivals:
    """Two models that differ in one family and fit the data so far equally well."""

    def __init__(self, names: tuple[str, str], one: _Form, other: _Form, dataset: Dataset, noise: Floats) -> None:
        self.names = names
        self.forms = one, other
        self.groups, self.noise = dataset.groups, noise
        difference = one.fit.predicted - other.fit.predicted
        apart = [difference[part] for part in dataset.parts]
        self._so_far = [
            _sum(
                form.model,
                [self._imitating(form, f, sign * d) for f, d in zip(form.fit.flights, apart, strict=True)],
            )
            for form, sign in ((other, 1.0), (one, -1.0))
        ]

    def sigmas(self, flight: Flight) -> float:
        """Expected distance between the two models by the data of `flight`, whichever is true, in standard deviations.

        The squared distance is the difference of the predictions that the wrong model cannot imitate: by its
        parameters, held by the data so far, and by the nuisances of every flight. Only the part that the new flight
        adds is counted, since the data so far did not distinguish the two.
        """
        one, other = self.forms
        by_one, by_other = (predict_targets(form.model, flight, self.groups) for form in self.forms)
        new = self._imitating(other, flight, by_one - by_other), self._imitating(one, flight, by_other - by_one)
        added = [(a + b).left - a.left for a, b in zip(self._so_far, new, strict=True)]
        return math.sqrt(max(0.0, min(added)))

    def _imitating(self, form: _Form, flight: Flight, difference: Floats) -> Information:
        return information(form.model, flight, self.groups, self.noise, difference)


def _rivals(diagnosis: Diagnosis, form: _Form, noise: Floats) -> list[_Rivals]:
    """Pairs of confounded effects that concern the best model: with one or the other of the two in it, refitted."""
    dataset, best = diagnosis.dataset, diagnosis.best
    kinds = {effect.family(): effect for effect in reversed(every_effect(best.effect_files).values())}
    kinds |= {
        candidate.family: type(candidate.effect) for candidate in reversed(diagnosis.ranking)
    }  # the best variants
    present = {effect.family() for effect in best.effects}
    found = []
    for held, other in diagnosis.confounded:
        if held not in present or other in present or other not in kinds:  # a session may name what is not known here
            continue
        stack = tuple(item for item in best.stack if item.effect.family() != held)
        without = fit_model(replace(best, stack=stack), dataset)
        fit, _ = fit_on_top(kinds[other], Unmodelled(without))
        found.append(_Rivals((held, other), form, _known(fit, noise), dataset, noise))
    return found


def _known(fit: FittedModel, noise: Floats, considering: bool = False) -> _Form:
    model, groups = fit.model, fit.dataset.groups
    flights = [information(model, flight, groups, noise, considering=considering) for flight in fit.flights]
    return _Form(fit, _sum(model, flights))


def _sum(model: Model, flights: Sequence[Information]) -> Information:
    return sum(flights, prior(model))


def _noise(residual: Floats, dataset: Dataset) -> Floats:
    """Standard deviation of each axis, shape (axes,), for independent samples whose mean has the same standard error as
    the mean of these correlated samples."""
    n = len(residual)
    long_run = [CorrelatedNoise(axis, dataset).variance_of_sum(np.ones(n)) / n for axis in residual.T]
    return np.asarray(np.maximum(np.sqrt(long_run), noise_scale(residual)))


def _brings(effect: type[Effect], dataset: Dataset, flight: Flight) -> bool:
    """Tell whether the data together with `flight` vary as much as `effect` needs."""
    both = Dataset((*dataset.flights, flight), dataset.hold_out)
    return all(both.span(variable) >= span for variable, span in effect.needs.items())


def _plans(folder: Path, model: Model, dataset: Dataset) -> tuple[list[tuple[Mission, str, Flight]], list[str]]:
    """Missions that can be flown with their commands and planned flights, and the reasons why others cannot."""
    plans, left_out = [], []
    for path in mission_files(folder):
        try:
            mission = load_mission(path)
            plans.append((mission, f"quadctl fly {name_of(path)}", planned_flight(mission, model, dataset)))
        except QuadctlError as error:
            left_out.append(str(error))
    return plans, left_out


def _widest(now: Floats, after: Sequence[Floats]) -> int | None:
    """Index of the parameter with the widest interval that some mission at least halves, else of the widest
    interval."""
    if not len(now) or not after:
        return None
    halved = np.min(after, axis=0) < 0.5 * now
    return int(np.argmax(np.where(halved, now, 0.0) if halved.any() else now))


def _separated(sigmas: Sequence[float]) -> float:
    """Mean ratio of the distances to `ENOUGH_SIGMAS`, each at most 1."""
    return float(np.mean(np.minimum(sigmas, ENOUGH_SIGMAS))) / ENOUGH_SIGMAS if sigmas else 0.0


def _narrowed(now: float | None, expected: float | None) -> float:
    """Logarithmic share of the narrowing from the present width to `NARROW` that a mission is expected to achieve."""
    if now is None or expected is None or now <= NARROW:
        return 0.0
    return math.log(now / max(expected, NARROW)) / math.log(now / NARROW)


def _ordered(options: Sequence[Option]) -> list[Option]:
    """Options sorted, the best first: the first question decides; among equal ones the next question; then the shorter
    flight."""
    left, found = list(options), []
    while left:
        leading = left
        for question in range(len(leading[0].gains)):
            most = max(option.gains[question] for option in leading)
            leading = [option for option in leading if option.gains[question] > most - EQUAL_GAIN]
        found.append(min(leading, key=lambda option: option.mission.duration_s))
        left.remove(found[-1])
    return found


def _plus_minus(width: float) -> str:
    return f"±{50.0 * width:.2g}%" if width < UNKNOWN else "unknown"
