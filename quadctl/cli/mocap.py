"""The command that feeds motion-capture poses to the autopilot."""

import enum
import math
import threading
from typing import Annotated, Any

import typer

from quadctl.cli.app import app, console
from quadctl.cli.output import say


class FrameName(enum.StrEnum):
    """The axes that a motion-capture system may have; `mocap.axes.FRAMES` says what they mean."""

    NWU = "nwu"
    ENU = "enu"
    Y_UP = "y_up"
    NED = "ned"


@app.command()
def mocap(
    source: Annotated[
        str,
        typer.Option(
            "--source",
            metavar="URL",
            help="udp://0.0.0.0:5005, vicon|optitrack|qualisys|vrpn://HOST, replay:FILE.jsonl",
        ),
    ],
    link: Annotated[
        str, typer.Option("--link", metavar="URL", help="A link of its own: auto, udpin://..., serial:///dev/...:BAUD")
    ],
    body: Annotated[str, typer.Option("--body", metavar="NAME", help="The vehicle's name in motion capture.")],
    frame: Annotated[
        FrameName, typer.Option("--frame", help="nwu, enu: z up; y_up: Motive's default; ned.")
    ] = FrameName.NWU,
    yaw: Annotated[
        float,
        typer.Option("--yaw", metavar="DEG", min=-360.0, max=360.0, help="Heading of motion capture's north axis."),
    ] = 0.0,
    origin: Annotated[
        str | None,
        typer.Option(
            "--origin",
            metavar="LAT,LON,ALT",
            help="Origin of the autopilot's frame, if it has none: degrees, and metres above the sea.",
        ),
    ] = None,
) -> None:
    """Forward motion-capture poses to the autopilot.

    Until Ctrl-C; their age is reported.
    """
    from quadctl.flight.autopilot.ports import resolve
    from quadctl.mocap.capture import open_source
    from quadctl.mocap.forward import forward

    opened = open_source(source, body)
    place = None if origin is None else _origin(origin)
    flow = forward(resolve(link, console), opened, frame.value, math.radians(yaw), console, threading.Event(), place)
    say(f"{flow.sent} poses sent: {flow.line(None)}")


def _origin(text: str) -> Any:
    """Origin of the option's text."""
    from quadctl.mocap.forward import Origin

    try:
        origin = Origin(*map(float, text.split(",")))
    except (TypeError, ValueError):
        raise typer.BadParameter(f"--origin is '{text}', expected LATITUDE,LONGITUDE,ALTITUDE") from None
    if not (abs(origin.latitude_deg) <= 90.0 and abs(origin.longitude_deg) <= 180.0 and abs(origin.altitude_m) < 1e4):
        raise typer.BadParameter(f"--origin is '{text}', expected degrees and metres, such as 47.3977,8.5456,488")
    return origin
