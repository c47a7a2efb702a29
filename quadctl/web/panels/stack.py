"""The effect stack: what the model holds, how sure its parameters are, and what single flights have of their own."""

from typing import TYPE_CHECKING

import numpy as np
from nicegui import ui

from quadctl.lab.comparison.wording import plain
from quadctl.lab.fitting.nuisances import KINDS
from quadctl.model import StackedEffect
from quadctl.web.elements.html import tag

if TYPE_CHECKING:
    from quadctl.web.page.page import Page

NUISANCES = {
    "thrust_scale": ("thrust", 100.0, "%"),
    "roll_rad": ("roll", np.degrees(1.0), "°"),
    "pitch_rad": ("pitch", np.degrees(1.0), "°"),
    "height_m": ("height", 1000.0, "mm"),
    "delay_s": ("age of rotor signal", 1000.0, "ms"),
}
"""Those that act on the acceleration, as a person reads them: name, factor, unit."""


def draw_stack(page: "Page") -> None:
    rung = page.bench.session.rung
    if rung is None:
        return
    with tag("section", "card stack").props('aria-label="Effect stack"'):
        with tag("div", "line"):
            tag("h2", "title grow", "Effects in the model")
            if rung.model.stack:
                refit = ui.button("Refit", on_click=lambda: page.act(page.bench.refit()))
                page.when_idle(refit.props("flat dense no-caps"), not page.bench.session.off)
        if not rung.model.stack:
            tag("p", "muted", f"None yet: the rigid body of {rung.model.vehicle.name}, weight and rotor thrust alone.")
        for item in rung.model.stack:
            _effect(page, item)
        _nuisances(page)


def _effect(page: "Page", item: StackedEffect) -> None:
    effect, bench = item.effect, page.bench
    on = effect.name not in bench.session.off
    with tag("div", "effect" if on else "effect off"):
        with tag("div", "line"):
            switch = ui.switch(value=on, on_change=lambda: page.act(bench.switch(effect.name)))
            page.when_idle(switch.props(f'dense aria-label="{effect.name} on or off"'))
            tag("span", "effect-name grow", plain(effect.family())).props(f'title="{effect.name}"')
            remove = ui.button(icon="close", on_click=lambda: page.act(bench.remove(effect.name)))
            page.when_idle(remove.props(f'flat dense round size=sm aria-label="Remove {effect.name}"'))
        tag("div", "mono muted", effect.name)
        ci95 = item.fitted.ci95 if item.fitted else {}
        units = {p.name: p.unit for p in effect.parameters()}
        with tag("dl", "parameters"):
            for name, value in effect.values().items():
                tag("dt", "", name)
                with tag("dd"):
                    tag("span", "", f"{value:.4g} {units[name]}".strip())
                    if name in ci95:
                        low, high = ci95[name]
                        tag("span", "muted", f" [{low:.3g}, {high:.3g}]").props('title="95% interval"')


def _nuisances(page: "Page") -> None:
    evaluation, seen = page.bench.results.evaluation, page.bench.seen
    if evaluation is None or seen is None:
        return
    with ui.expansion("What single flights have of their own").classes("nuisances").props("dense"):
        tag("p", "muted", "Trims that differ from flight to flight; fitted beside the effects, not part of the model.")
        kinds = [kind.name for kind in KINDS]
        with tag("table", "small"):
            with tag("tr"):
                tag("th", "", "flight")
                for name, _, unit in NUISANCES.values():
                    tag("th", "number", f"{name} / {unit}")
            for flight, values in zip(seen.names, evaluation.nuisances, strict=True):
                with tag("tr"):
                    tag("td", "", flight)
                    for kind, (_, factor, _) in NUISANCES.items():
                        tag("td", "number", f"{factor * values[kinds.index(kind)]:+.2f}".replace("-", "\u2212"))
