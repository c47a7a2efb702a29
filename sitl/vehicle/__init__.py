"""The simulated vehicle: rigid body, rotors, battery, ground, estimator, attitude and rate loops, hidden truth.

Motor outputs come in, true motion and a noisy, delayed estimate go out, one step of physics at a time. It never reads
a clock, and knows nothing of modes.
"""
