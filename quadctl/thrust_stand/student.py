"""Student's t distribution for whole degrees of freedom, where it has closed forms: the companion computer has no
scipy.

Source: Abramowitz and Stegun, Handbook of Mathematical Functions, 26.7.3 and 26.7.4.
"""

import math


def two_sided_p(t: float, freedom: int) -> float:
    """Probability that noise alone gives a |t| as large, with `freedom` >= 1 degrees of freedom.

    The square of t with f degrees is F with (1, f): the F-test of one more parameter is this too.
    """
    angle = math.atan(abs(t) / math.sqrt(freedom))
    cos2 = math.cos(angle) ** 2
    odd = freedom % 2
    term = math.sin(angle) * (math.cos(angle) if odd else 1.0)
    total = 0.0
    for i in range(2 + odd, freedom + 1, 2):
        total += term
        term *= cos2 * (i - 1) / i
    inside = 2.0 / math.pi * (angle + total) if odd else total
    return min(max(1.0 - inside, 0.0), 1.0)


def t_95(freedom: int) -> float:
    """Half width of the 95 % interval in standard errors."""
    low, high = 1.9, 13.0  # from infinitely many degrees of freedom to one
    while high - low > 1e-9:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if two_sided_p(middle, freedom) > 0.05 else (low, middle)
    return low
