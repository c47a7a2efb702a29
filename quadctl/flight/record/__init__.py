"""Records of a flight under way: the log, the display in the terminal, and the data of the live view.

Ticks come in; a CSV file with its meta file, lines on a terminal and records for a page go out. It never delays the
loop: whatever may block runs on a thread or in a process of its own.
"""
