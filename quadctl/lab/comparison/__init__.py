"""Comparison: the error of a model on flights, the conditions under which it is large, and its reference error.

Input: a `Model` and a `Dataset`. Output: a `Comparison` with the residual, the reference error, the ranges of the
variables in which the model fails, the open-loop error, and sentences about them. No parameter is fitted.
"""
