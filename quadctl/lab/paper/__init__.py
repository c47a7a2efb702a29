"""Files for a paper: a fitted model as LaTeX, BibTeX and JSON."""

from quadctl.lab.paper.latex import paper_files
from quadctl.lab.paper.statement import Statement, state

__all__ = ["Statement", "paper_files", "state"]
