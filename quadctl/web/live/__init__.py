"""The live view of a flight: a page of its own, served by a process of its own."""
