"""Planning: which mission to fly next.

In come a `Diagnosis` and a folder of missions; out comes a `Suggestion`: how far each mission would separate look-
alikes, narrow an interval, or show effects that could not be tried, computed before anything flies.
"""
