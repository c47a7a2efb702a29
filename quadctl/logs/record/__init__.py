"""The record of a flight, judged before any physics: what a log says of itself, and what of it can be used."""
