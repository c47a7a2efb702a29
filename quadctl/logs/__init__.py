"""Flight logs: `read.py` reads any format into a `FlightLog`, `columns.py` names the columns. Imports no library."""
