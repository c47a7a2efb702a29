"""Colours of the page and its figures, light and dark: Okabe and Ito's, which colour-blind readers tell apart.

They mean the same as in the report: measured is black (white on dark), the model before is vermilion, the model after
is blue, the reference error is green.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Theme:
    """Colours as CSS has them."""

    name: str
    ink: str
    muted: str
    grid: str
    surface: str
    measured: str
    before: str
    after: str
    floor: str
    highlight: str
    others: tuple[str, ...]
    band: str
    """Background of a range that was measured."""


LIGHT = Theme(
    "light", "#1C2127", "#59636E", "#E3E7EB", "#FFFFFF", "#22272E", "#D55E00", "#0072B2", "#009E73", "#CC79A7",
    ("#E69F00", "#CC79A7", "#56B4E9", "#009E73"), "rgba(0,114,178,0.09)",
)  # fmt: skip
DARK = Theme(
    "dark", "#E9EDF1", "#9AA5B1", "#2C333C", "#1A1F26", "#F2F4F6", "#E8762C", "#56B4E9", "#2BC08F", "#E39BC4",
    ("#E69F00", "#E39BC4", "#8FA3FF", "#2BC08F"), "rgba(86,180,233,0.12)",
)  # fmt: skip
