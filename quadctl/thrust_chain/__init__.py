"""The thrust chain: functions of a firmware's parameters between the commanded thrust and the motor outputs.

Each firmware has a file. Flight divides out what the firmware multiplies, the readers of logs turn outputs into thrust,
`quadctl check --link` says what is added, and the simulator adds it.
"""
