"""Errors of the sensors of the height: where a barometer fails, why, and the parameters that mend it.

The same question as that of the lab, asked of a sensor: its reading is compared with a reference that does not lean on
it, and the errors of `quadctl.effects.sensors` are tried on the difference.
"""
