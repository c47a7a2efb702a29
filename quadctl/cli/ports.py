"""The command that shows where an autopilot may be plugged in."""

from dataclasses import asdict

from rich.table import Table

from quadctl.cli.app import app, console
from quadctl.cli.output import JsonOption, write_json


@app.command()
def ports(json_out: JsonOption = None) -> None:
    """List the serial ports with what is plugged in.

    `fly --link auto` listens to all that may be an autopilot.
    """
    from quadctl.flight.autopilot.ports import serial_ports

    found = serial_ports()
    write_json(json_out, {"ports": [asdict(port) for port in found]})
    if not found:
        console.print("no serial ports")
        return
    table = Table("device", "what is plugged in", "may be an autopilot", box=None, pad_edge=False, padding=(0, 3, 0, 0))
    for port in found:
        table.add_row(port.device, port.what, "yes" if port.likely else "")
    console.print(table)
