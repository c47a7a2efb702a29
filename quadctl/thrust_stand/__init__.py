"""One motor on a stand: thrust over rotor speed and over throttle, measured, fitted, written into the vehicle file."""
