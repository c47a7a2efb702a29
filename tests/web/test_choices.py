"""A link to a state of the page: the choices of a tab as the query of its address."""

import pytest

from quadctl.web.panels.choices import Choices, choices_of

ALL = Choices(
    show="time",
    axis="north",
    flight="a flight & more.csv",
    channels=("z_m", "motor1_rpm"),
    over_each_other=True,
    beside="1",
    evidence="ground_effect.hayden",
    brush={"height_over_radius": (0.5, 2.25), "time": (-1.0, 30.0)},
)


@pytest.mark.parametrize("choices", [Choices(), ALL, Choices(channels=())])
def test_the_address_gives_the_choices_back(choices: Choices) -> None:
    assert choices_of(choices.query()) == choices
    assert choices_of(f"?{choices.query()}") == choices


def test_the_address_says_only_what_differs_from_a_new_tab() -> None:
    assert Choices(show="fails", axis="east").query() == "show=fails&axis=east"


@pytest.mark.parametrize(
    "query",
    [
        "",
        "axis=sideways",
        "brush=height_over_radius:a:b",
        "brush=nothing:1:2",
        "brush=time:1",
        "brush=time:nan:1",
        "x=1",
    ],
)
def test_what_is_wrong_in_an_address_is_as_in_a_new_tab(query: str) -> None:
    assert choices_of(query) == Choices()
