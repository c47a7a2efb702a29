"""Find the effect that a flight model lacks, in a log, and add it to the model."""

import tempfile
from pathlib import Path

from simulator import VEHICLE, fly

from quadctl.lab import add, compare, diagnose, load_model, prepare_flights, save_model

folder = Path(tempfile.mkdtemp(prefix="quadctl-"))
log = fly("hover_staircase", folder)

# A model without effects: rotor thrust and weight. Preparing a log takes longest, so it is done once.
rigid_body = load_model(VEHICLE)
flights = prepare_flights(log, rigid_body.vehicle)

# How wrong is it, and where?
comparison = compare(rigid_body, flights)
print(f"acceleration error of the rigid body: {comparison.rmse['total']:.3f} m/s^2")
print(f"reference error:                      {comparison.noise_floor['total']:.3f} m/s^2")
for failure in comparison.fails_where[:3]:
    where = f"{failure.variable} from {failure.low:.3g} to {failure.high:.3g}"
    print(f"it fails {failure.axis} at a {where}: {failure.mean_residual:+.2f} m/s^2 ({abs(failure.sigma):.0f} sigma)")

# What is missing? Without the third argument every effect of the catalogue is tried, which takes longer.
candidates = ["thrust_scale", "rotor_drag", "inflow", "battery_sag", "ground_effect.exponential"]
diagnosis = diagnose(rigid_body, flights, candidates)
print(f"verdict: {diagnosis.verdict}: {', '.join(diagnosis.missing)}")

# Add it. The errors before and after are those of held-out data.
found = diagnosis.ranking[0].effect
addition = add(found.name, rigid_body, flights)
print(f"held-out error: {addition.before['total']:.3f} -> {addition.after['total']:.3f} m/s^2 with {found.name}")

save_model(addition.model, folder / "fitted.yaml")
print(f"model to fly with `quadctl fly MISSION --model`: {folder / 'fitted.yaml'}")
