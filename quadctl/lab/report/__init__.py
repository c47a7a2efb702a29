"""Report: the lab's results as one HTML page with sentences, figures and tables, without external resources.

Each section is a function from the results to a `Section`; the template only lays them out. All text is escaped by the
template, and the figures contain their text as escaped SVG.
"""
