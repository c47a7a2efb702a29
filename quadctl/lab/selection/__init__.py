"""Selection: the effects that a model is missing; models with effects added, removed and refitted.

Input: a `FittedModel`. Output: a `Diagnosis` (candidates, path of the search, unexplained part) or a `Refit`. All
decisions are made in `rule.py`; candidates hold the data that it decides on.
"""
