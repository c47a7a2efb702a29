"""The blind proof of a diagnosis: flights whose hidden truth is physics of its own, and a scoreboard."""
