"""Errors of forecasts of the whole state, as a job of the page or a command gets them."""

import numpy as np

from quadctl.lab.rotation.rollout_errors import FORECAST, HELD, HORIZONS_S, QUANTITIES, SAVED, Unseen

_BLOCKS = np.random.default_rng(4).uniform(0.8, 1.2, (6, len(HORIZONS_S), len(QUANTITIES)))
ROLLOUTS = Unseen({HELD: 0.2 * _BLOCKS, SAVED: 0.16 * _BLOCKS, FORECAST: 0.13 * _BLOCKS[::-1]})
