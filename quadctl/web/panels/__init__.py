"""Panels of the lab page: each is a frozen dataclass whose fields are all that it shows.

The fields are filled from a `View`, the state of the page at one moment; elements of NiceGUI go out, and what a person
does with them goes to the `Controls`.
"""
