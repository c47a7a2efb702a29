"""Figures of the lab page: pure functions, one kind of figure a file.

Results of the lab and a theme come in; figures go out, as Plotly takes them.
"""
