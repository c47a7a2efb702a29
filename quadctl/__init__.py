"""quadctl: fly a multirotor from a companion computer, and find out which physics its model is missing."""

__version__ = "0.1.0"
