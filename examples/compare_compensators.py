"""Compare compensators: the same step down into the ground effect, flown without one and with several."""

import tempfile
from pathlib import Path

import numpy as np
from simulator import VEHICLE, fly

from quadctl.lab import add, read_log, save_model

folder = Path(tempfile.mkdtemp(prefix="quadctl-"))

# A compensator of our own: the ground effect, fitted to a flight of the same vehicle.
fitted = folder / "fitted.yaml"
save_model(add("ground_effect.exponential", VEHICLE, fly("hover_staircase", folder)).model, fitted)

# The first two seconds of a step are the same for all; after them the ground effect keeps the vehicle too high.
SETTLED_S = 2.0
print(f"compensator   height error (RMSE), from {SETTLED_S:g} s after the step")
for name, model in {"none": "none", "hayden": "hayden", "fitted": str(fitted)}.items():
    log = read_log(fly("step_response", folder, model, seed=2))
    assert log.phase is not None
    step = log.phase == "step"
    late = step & (log.time_s > log.time_s[step][0] + SETTLED_S)
    error_m = log["z_m"][late] - log["z_ref_m"][late]
    print(f"{name:13} {np.sqrt(np.nanmean(error_m**2)):.4f} m")
