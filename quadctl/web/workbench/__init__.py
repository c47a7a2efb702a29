"""The workbench: one analysis, without any user interface.

Actions and files come in; jobs are started, and whoever listens is told that the state has changed.
"""
