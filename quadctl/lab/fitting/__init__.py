"""Fitting: the parameters of a model and the nuisances of each flight, by robust nonlinear least squares.

Input: a `Model` and a `Dataset`. Output: a `FittedModel` with parameters, nuisances, held-out residual, and bootstrap
draws for intervals. The parts of a fit are here too: Jacobian, normal equations, priors, noise, significance tests.
"""
