"""Comparison: the error of a model on flights, where it is large, and how small it could be.

In come a `Model` and a `Dataset`; out comes a `Comparison`: residual, noise floor, ranges of the variables in which the
model fails, open-loop error, and all of it in words. Nothing is fitted to the model.
"""
