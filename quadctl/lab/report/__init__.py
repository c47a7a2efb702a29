"""The lab's results as one page that a person reads from top to bottom: sentences, figures, tables, nothing external.

Every section is a function from the results to a `Section`; the template only sets them. All text passes through the
template's escaping, and the figures carry their text as escaped SVG.
"""

from quadctl.lab.report.page import render_report, write_report
from quadctl.lab.report.parts import Results

__all__ = ["Results", "render_report", "write_report"]
