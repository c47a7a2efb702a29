"""The model sequence: the acceleration error of the current model, and of each step before it."""

import re
from dataclasses import dataclass

from nicegui import ui

from quadctl.lab.comparison.agreement import flights_of_the_fit
from quadctl.lab.comparison.wording import (
    FLOOR,
    bias_of,
    change_in_words,
    held_out,
    listed,
    number,
    plain,
    roughly,
    where,
)
from quadctl.lab.evaluation import Evaluation
from quadctl.lab.fitting.fitted_model import is_fitted_to
from quadctl.lab.flights.dataset import Dataset
from quadctl.web.elements.html import tag
from quadctl.web.panels.glossary import explained
from quadctl.web.panels.panel import Controls, Panel
from quadctl.web.panels.vehicle import WhichVehicle
from quadctl.web.panels.words import Said
from quadctl.web.session.session import Session, Step
from quadctl.words import Fact, fact


@dataclass(frozen=True)
class ModelSequence(Panel):
    """The held-out error of the current model in large, and a bar for each step of the model sequence."""

    session: Session
    seen: Dataset | None
    evaluation: Evaluation | None
    floor_m_s2: float | None
    starting: bool
    idle: bool

    def draw(self, do: Controls) -> None:
        session, evaluation = self.session, self.evaluation
        with tag("section", "card sequence").props('aria-label="Model sequence"'):
            if self.starting:
                tag("p", "muted", "The acceleration error of your model, on held-out data, appears here.")
                return
            now = self._error_now()
            judged = [(step.name, step.error_m_s2) for step in session.sequence if step.error_m_s2 is not None]
            errors = [error for _, error in judged]
            with tag("div", "now"):
                if now is None:
                    tag("div", "big", "\u2013" if self.idle else "\u2026")
                else:
                    with tag("div", "big"):
                        tag("span", "", number(now)).props('id="error-now"')
                        tag("span", "unit", "m/s²")
                    if errors and now < 0.995 * errors[0]:
                        change = change_in_words(1.0 - now / errors[0])
                        tag("span", "change", f"{change} since {_plain(judged[0][0])}")
            if evaluation is not None:
                if self.seen is not None:
                    with tag("p", "muted what"):
                        explained(str(self._kind_of_error(evaluation, self.seen)))
                if evaluation.agreement is not None:
                    with tag("p", "what").props('id="agreement"'):
                        tag("b", "", str(evaluation.agreement.answer))
                        tag("span", "", " See the tab Where it fails.")
            do.nest(WhichVehicle)
            largest = max([*errors, now or 0.0, 1e-9])
            least = self.floor_m_s2
            bars = _Bars(largest, None if least is None else min(least / largest, 1.0), self.idle)
            with tag("ol", "steps"):
                for i, step in enumerate(session.sequence):
                    here = i == session.current and not session.off
                    bars.draw(do, i, step.name, step.error_m_s2, here, self._stands(step))
                if session.off:
                    bars.draw(do, session.current, f"without {listed(sorted(session.off))}", now, True)
            if least is not None:
                with tag("p", "floor-key"):
                    tag("span", "floor-mark")
                    with tag("span"):
                        explained(f"reference error {roughly(least)}: {FLOOR}")

    def _stands(self, step: Step) -> bool:
        """Tell whether the error of a step is that of a model that was not fitted to these flights."""
        return self.seen is not None and not is_fitted_to(step.model, self.seen.names)

    def _error_now(self) -> float | None:
        """Error of the current model, m/s²; the saved one while the evaluation runs, None where there is none."""
        if self.evaluation is not None:
            return self.evaluation.error_m_s2
        return None if self.session.step is None or self.session.off else self.session.step.error_m_s2

    def _kind_of_error(self, evaluation: Evaluation, seen: Dataset) -> Fact:
        """The error, and the data that it is computed on."""
        error = {"error_m_s2": evaluation.error_m_s2}
        if evaluation.unseen is not None:
            names = evaluation.unseen.dataset.names
            used = [] if self.session.step is None else flights_of_the_fit(self.session.step.model, names)[0]
            known = [name for name in names if name in used]
            if known:
                return fact(Said.ERROR_KNOWN, **error, flights=names, fitted=known)
            return fact(Said.ERROR_ON, **error, where=where(seen, names))
        if evaluation.kind == "as it stands":
            used = flights_of_the_fit(evaluation.comparison.model, seen.names)[0]
            return fact(Said.ERROR_AS_IT_STANDS, **error, where=where(seen, (), as_it_stands=True), fitted=used)
        data = {"bias": bias_of(seen), "held_out": held_out(seen), "refitted": bool(self.session.off)}
        return fact(Said.ERROR_CROSS_VALIDATED, **error, **data)


@dataclass(frozen=True)
class _Bars:
    """The bars of the model sequence, to one scale."""

    largest: float
    """Error of a bar of full length, m/s²."""
    floor: float | None
    """Reference error, as a share of the full length."""
    idle: bool

    def draw(
        self, do: Controls, step: int, name: str, error: float | None, here: bool, as_it_stands: bool = False
    ) -> None:
        """Draw one step as a button that goes back to it; `here`: it is the current one."""
        with tag("li", "step here" if here else "step"):
            button = ui.element("button").classes("step-button").props('type="button"')
            button.props(f'aria-current="{"step" if here else "false"}"')
            button.on("click", lambda: do.act(do.bench.go(step)))
            if not self.idle:
                button.props("disabled")
            with button:
                tag("span", "step-name", _plain(name)).props(f'title="{name}"')
                value = tag("span", "step-value", number(error) if error is not None else "\u2013")
                if error is None:
                    value.props('title="not computed with these flights yet"')
                with tag("span", "bar-room"):
                    if error is not None:
                        length = 100.0 * error / self.largest
                        tag("span", "bar first" if step == 0 else "bar").style(f"width:{length:.1f}%")
                    if self.floor is not None:
                        tag("span", "floor").style(f"left:{100.0 * self.floor:.1f}%")
                if as_it_stands and error is not None:
                    tag("span", "step-kind", "not fitted to all of these flights")


def _plain(name: str) -> str:
    """`+ ground effect` for `+ ground_effect.exponential`"""
    return re.sub(r"(\w+)\.\w+", lambda found: plain(found[1]), name)
