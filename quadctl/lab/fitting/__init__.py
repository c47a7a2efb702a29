"""Fitting: the parameters of a model and the nuisances of single flights, by robust nonlinear least squares.

In come a `Model` and a `Dataset`; out comes a `FittedModel`: parameters, nuisances, held-out residual, and bootstrap
draws for intervals. Also here is what a fit stands on (Jacobian, normal equations, priors, noise, tests of
significance).
"""
