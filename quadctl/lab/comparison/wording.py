"""Sentences and numbers about results, shared by the report and the page."""

from collections.abc import Callable, Mapping, Sequence

from quadctl.effects import Effect
from quadctl.frames import GRAVITY_M_S2
from quadctl.lab.comparison.comparison import Comparison
from quadctl.lab.comparison.failures import Failure
from quadctl.lab.flights.dataset import FOLDS, Dataset
from quadctl.lab.flights.flight import VARIABLE_NAMES, VARIABLE_UNITS
from quadctl.lab.flights.preparation import BLOCK_S

UNIT = "m/s²"


def number(value: float) -> str:
    """Format with three significant digits."""
    return f"{value:#.3g}".removesuffix(".")


def quantity(value: float) -> str:
    """Format an acceleration with its unit."""
    return f"{number(value)} {UNIT}"


def percent(share: float) -> str:
    return f"{share:.0%}".replace("-", "\u2212")


def share_of_g(value: float) -> str:
    """Format an acceleration, m/s^2, as a share of gravity with two digits: `4.1%`."""
    share = 100.0 * value / GRAVITY_M_S2
    return f"{share:.0f}%" if share >= 9.95 else f"{share:.1f}%" if share >= 0.095 else f"{share:.2f}%"


def p_in_words(p: float) -> str:
    """Format a p-value, such as `< 0.0001`, `0.003`, `0.62`."""
    return "< 0.0001" if p < 1e-4 else f"{p:.1g}" if p < 0.01 else f"{p:.2f}"


def change_in_words(drop: float) -> str:
    """Format the change of an error from its relative drop, with a true minus sign; `0%` where it rounds to zero."""
    percent = round(-100.0 * drop)
    return f"{percent:+d}%".replace("-", "\u2212") if percent else "0%"


def plus(value: float) -> str:
    return f"{value:+.3f}".replace("-", "\u2212")


def parameters_in_text(effect: Effect, ci95: Mapping[str, tuple[float, float]]) -> str:
    """Fitted parameters with units and 95 % intervals: `a = 0.114 [0.1, 0.12], b = 5.4 1/m [5, 5.8]`."""
    values, units = effect.values(), {p.name: f" {p.unit}" if p.unit else "" for p in effect.parameters()}
    parts = [
        f"{name} = {_parameter(values[name])}{units[name]} {_interval(values[name], ci, _parameter)}"
        for name, ci in ci95.items()
    ]
    return ", ".join(parts) or "no free parameters"


def parameter_lines(effect: Effect, ci95: Mapping[str, tuple[float, float]]) -> list[str]:
    """Parameters with 95 % intervals, one a line: `a = 0.114 [0.10, 0.12]`.

    One that is not fitted, but chosen from the data or from the literature, has no interval: `rotor = 1`.
    """
    return [
        f"{name} = {value:.4g} {interval_in_words(value, ci95[name])}" if name in ci95 else f"{name} = {value:.4g}"
        for name, value in effect.values().items()
    ]


def parameters_in_words(effect: Effect, ci95: Mapping[str, tuple[float, float]]) -> str:
    """Parameters with 95 % intervals: `a = 0.114 [0.10, 0.12], b = 5.4 [5.0, 5.8], c = 1` (see `parameter_lines`)."""
    return ", ".join(parameter_lines(effect, ci95)) or "-"


def interval_in_words(value: float, ci95: tuple[float, float]) -> str:
    """95 % interval of a value, `[0.10, 0.12]`; that of a parameter at a bound has one end, `(at most 0.12)`."""
    return _interval(value, ci95, lambda end: f"{end:.4g}")


def _interval(value: float, ci95: tuple[float, float], shown: Callable[[float], str]) -> str:
    low, high = ci95
    if low < high and value == low:
        return f"(at most {shown(high)})"
    if low < high and value == high:
        return f"(at least {shown(low)})"
    return f"[{shown(low)}, {shown(high)}]"


def _parameter(value: float) -> str:
    """Format a value; less than a millionth is shown as 0, which the solver has not quite reached."""
    return f"{value if abs(value) > 1e-6 else 0.0:.4g}".replace("-", "\u2212")


def held_out(dataset: Dataset) -> str:
    if dataset.hold_out == "flights" and len(dataset.flights) > 1:
        return "held-out flights (cross-validation)"
    return f"held-out blocks of {BLOCK_S:.0f} s ({FOLDS}-fold cross-validation)"


def flights_in_words(names: Sequence[str]) -> str:
    return listed(names) if len(names) <= 3 else f"{len(names)} flights"


def variance_in_words(c: Comparison) -> str:
    if c.explained > 0.0:
        return f"The model explains {percent(c.explained)} of the acceleration's variance."
    return "The model is worse than predicting the mean acceleration."


def count(n: int, what: str) -> str:
    return f"{n} {what}{'' if n == 1 else 's'}"


def listed(words: Sequence[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


def plain(family: str) -> str:
    return family.replace("_", " ")


def sentence(text: str) -> str:
    return text[:1].upper() + text[1:]


def failure_in_words(failure: Failure) -> str:
    return sentence(failure.text).replace("m/s^2", UNIT)


def label_of(variable: str) -> str:
    """Axis label of a variable with its unit, such as `climb rate / m/s`."""
    return f"{VARIABLE_NAMES[variable]} / {VARIABLE_UNITS[variable]}"
