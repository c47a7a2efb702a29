"""Random sequences of faults on the simulated autopilots: drawn by a seed, flown, and judged by what must never be."""
