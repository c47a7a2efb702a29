"""URLs that `--source` accepts."""

from pathlib import Path

from quadctl.errors import LinkError
from quadctl.mocap.capture import SYSTEMS, CaptureSource
from quadctl.mocap.sources import ReplaySource, Source, UdpSource

EXPECTED = "udp://0.0.0.0:5005, " + ", ".join(f"{system}://HOST" for system in SYSTEMS) + " or replay:FILE.jsonl"


def open_source(url: str, body: str) -> Source:
    """The source at `url` for the rigid body of that name; raises LinkError or LogError when there is no such."""
    scheme, _, rest = url.partition(":")
    place = rest.removeprefix("//")
    if scheme == "udp":
        host, _, port = place.rpartition(":")
        if host and port.isdecimal() and 0 < int(port) < 65536:
            return UdpSource(host, int(port), body)
    elif scheme in SYSTEMS and place:
        return CaptureSource(scheme, place, body)
    elif scheme == "replay" and place:
        return ReplaySource(Path(place), body)
    raise LinkError(f"The source {url!r} is not one that can be opened: expected {EXPECTED}.")
