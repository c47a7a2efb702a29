"""A figure in a sentence, for those who cannot see it."""

import numpy as np

from quadctl.web.elements.figure import axis, figure, in_a_sentence
from quadctl.web.elements.theme import LIGHT


def curve(name: str) -> dict[str, object]:
    return {"name": name, "x": np.array([0.0, 2.0, 4.0]), "y": np.array([1.5, np.nan, -0.25])}


def test_it_says_the_range_of_each_curve_with_the_titles_of_the_axes() -> None:
    drawn = figure([curve("measured")], LIGHT, 100, xaxis=axis("time / s", LIGHT), yaxis=axis("up / m/s²", LIGHT))
    assert in_a_sentence(drawn) == "measured: time / s from 0 to 4, up / m/s² from -0.25 to 1.5."


def test_of_many_curves_it_says_a_few_and_the_number_of_the_others() -> None:
    drawn = figure([curve(str(i)) for i in range(9)], LIGHT, 100)
    assert in_a_sentence(drawn).endswith("; and 3 more curves.")
