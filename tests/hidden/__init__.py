"""The blind proof of `quadctl.lab.diagnose`: flights whose hidden truth is physics of its own, and a scoreboard."""
