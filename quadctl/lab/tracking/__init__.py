"""Tracking: how well a controller followed its reference.

In come flight logs and their references; out come tracking errors (M_A, M_B, MAE, RMSE) with intervals, and step
responses on a common clock. No model is involved.
"""
