"""Planning: choice of the mission to fly next.

Input: a `Diagnosis` and a folder of missions. Output: a `Suggestion`. Before any flight it is computed how well each
mission would separate confounded effects, narrow an interval, or show effects that could not be tried.
"""
