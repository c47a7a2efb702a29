"""Thrust over height, measured on a bench or from hovers: every ground-effect formula is fitted and ranked."""
