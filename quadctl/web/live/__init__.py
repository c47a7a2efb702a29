"""The live view of a flight: a page of its own, served by a process of its own.

Records of the flight come in, ten a second; the wish to land goes out. Nothing here loads the lab, and `viewer`, which
the process that flies imports, loads no web library either.
"""
