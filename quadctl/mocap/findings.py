"""Facts about poses and the autopilot that is to take them, each with the template of its words."""

from enum import unique

from quadctl.words import By, Kinds, Words

_DIRECTIONS = (("north", "south"), ("east", "west"), ("down", "up"))
_WITHOUT_ORIGIN = (
    "without which PX4 does not get ready in hold, and ArduPilot does not use the poses: --origin "
    "LATITUDE,LONGITUDE,ALTITUDE gives it one"
)


def _direction(index_and_sign: tuple[int, bool]) -> str:
    axis, backward = index_and_sign
    return _DIRECTIONS[axis][backward]


@unique
class Kind(Kinds, words=Words({"direction": _direction})):
    # --- the axes ---
    TILTED = (
        "the rigid body is tilted {off_deg:.0f} deg away from the autopilot's attitude (--frame {frame}): ",
        By("best", {None: "define the rigid body anew on the level vehicle"}, "with --frame {best} they agree"),
    )
    HEADING_OFF = (
        "the rigid body's heading is {off_deg:+.0f} deg from the autopilot's: turn its x axis forward, or say --yaw "
        "{off_deg:.0f}, unless the autopilot has no compass and takes its heading from here"
    )
    MOVES_OTHERWISE = (
        "the vehicle moves {by_poses:direction} by motion capture and {by_autopilot:direction} by the autopilot: check "
        "--frame and --yaw"
    )
    # --- the autopilot ---
    HEARD_AGAIN = "the autopilot is heard again"
    SILENT = "the autopilot has gone silent"
    HAS_ORIGIN = "the autopilot has an origin already"
    TOOK_ORIGIN = "the autopilot has taken the origin"
    NO_ORIGIN = f"warning: the autopilot tells no origin of its frame on the globe, {_WITHOUT_ORIGIN}"
    ORIGIN_UNTOLD = "warning: the autopilot was sent the origin and does not tell it"
    # --- reasons to withhold a pose ---
    NOT_FINITE = "not a number"
    NO_ATTITUDE = "the quaternion is not of length 1"
    STALE = "stale"
    FROZEN = "frozen"
    REPEATED = "repeated"
    JUMPED = "jumped"
    OTHER_AXES = "against the autopilot's attitude"
    LINK_DOWN = "with the link down"
