"""The model that flies against the flight: its residual, the parameters that have changed, and those known by now."""
