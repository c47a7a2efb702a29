"""Symbolic: expressions for a residual that no effect of the catalogue explains.

Input: a held-out residual and its `Dataset`. Output: a `Symbolic` with a sparse expression and a compact form for each
axis, their intervals and held-out shares, and on request the text of a Python file that makes it an effect.
"""
