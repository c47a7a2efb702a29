"""Worlds whose physics are simulators of others: RotorPy (Folk et al. 2023) and drone-models (University of Toronto).

Rigid body, rotors, motors and the published vehicles are the simulator's. What is hidden and the simulator cannot say
is injected into it as forces and moments. World: x north, y west, z up; body: x forward, y left, z up.
"""
