"""The session: flight logs, the sequence of models, and what a search found for each, as values that are never changed.

Paths, models and findings come in; new sessions and the text of session files go out. The rules for the folder in which
files are kept are here too.
"""
