"""Figures of the page: pure functions from results to what Plotly draws, one kind a file."""
