"""Selection: which effects a model is missing, and models with effects added, removed and refitted.

In comes a `FittedModel`; out come a `Diagnosis` (candidates, the path of the search, what stays unexplained) or a
`Refit`. The decision is in one file, `rule.py`; candidates hold the data that it decides on.
"""
