"""Symbolic: expressions for a residual that no effect of the catalogue explains.

In come a held-out residual and its `Dataset`; out comes a `Symbolic`, a sparse expression and a compact form along each
axis with intervals and held-out share, and on request the text of a Python file that makes it an effect.
"""
