"""Reasons for which a flight does not begin, does not go on, or ends: facts, with one table of their words."""

from enum import unique
from typing import TypeAlias

from quadctl.words import By, Fact, Kinds, Words, fact

_WORDS = Words(
    {
        "mode": lambda mode: mode or "an unknown mode",
        "further": lambda texts: "".join(f"; {text}" for text in texts),
        "known": lambda known: "; ".join(f"{name} {value}" for name, value in known.items()),
    }
)


@unique
class Kind(Kinds, words=_WORDS):
    """Kinds of reasons, each with the template of its words."""

    TOLD = "{text}"
    """Words of somebody else: the autopilot, its link, the user."""
    # --- the state ---
    HEARTBEAT_LOST = "the autopilot's heartbeat is lost"
    NEVER_CAME = "the {part} never came"
    STALE = "the {part} is {age_s:.2f} s old, allowed are {most_s:g} s"
    SLOW_LINK = "the link is slow: the {part} is {age_s:.2f} s old when a setpoint arrives, allowed are {most_s:g} s"
    STATE_NOT_FINITE = "the state holds a value that is not a number"
    NO_ATTITUDE = "the attitude is no unit quaternion, its norm is {norm:.3g}"
    DISTRUSTED = "the autopilot's estimator does not trust its attitude, velocity or position"
    IN_DOUBT = "the autopilot's estimator is in doubt: innovation ratio {ratio:.2f}, allowed are {most:g}"
    AID_LOST = "the autopilot has lost its source of position (GPS, motion capture)"
    UNCERTAIN = "the estimator states a standard deviation of {std_m:.2f} m for the {part}, allowed are {most_m:g} m"
    FROZEN = "the {part} is frozen: the same values for {still_s:.2f} s, allowed are {most_s:g} s"
    POSITION_JUMP = "the position jumped by {jump_m:.2f} m, allowed are {most_m:g} m"
    VELOCITY_JUMP = "the velocity jumped by {jump_m_s:.1f} m/s, allowed are {most_m_s:g} m/s"
    ATTITUDE_JUMP = "the attitude jumped by {jump_deg:.0f} deg, allowed are {most_deg:g} deg"
    # --- the target ---
    TARGET_NOT_FINITE = "control gave a value that is not a number"
    TARGET_THROTTLE = "control gave a throttle of {throttle:.3g}, allowed are 0 to {most:g}"
    TARGET_NO_ATTITUDE = "control gave an attitude that is no unit quaternion, its norm is {norm:.3g}"
    TARGET_LATERAL = "control gave a lateral throttle of {lateral}, allowed are -{most:g} to {most:g}"
    TARGET_TILT = "control gave a tilt of {tilt_deg:.0f} deg, allowed are {most_deg:g} deg"
    CONTROL_FAILED = "control failed ({error})"
    # --- limits ---
    TILT = "the tilt is {tilt_deg:.0f} deg, allowed are {most_deg:g} deg"
    SPEED = "the speed is {speed_m_s:.1f} m/s, allowed are {most_m_s:g} m/s"
    HEIGHT = "the height is {height_m:.2f} m, allowed are {most_m:g} m"
    FLOOR = "the height is {height_m:.2f} m, allowed are {least_m:g} m or more"
    DISTANCE = "the vehicle is {distance_m:.2f} m from take-off, allowed are {most_m:g} m"
    TIME = "the flight lasts {in_air_s:.0f} s, the mission {mission_s:.0f} s"
    BATTERY = "the battery is at {battery_v:.2f} V, allowed are {least_v:g} V"
    BATTERY_AT_START = "the battery is at {battery_v:.2f} V, expected {least_v:g} V or more"
    # --- the flight beside its reference and its model ---
    ASTRAY = (
        "the mission is not followed: the {part} error has been over {most_m:g} m for more than {longest_s:g} s, it is "
        "{error_m:.2f} m"
    )
    CARRIED = "the vehicle touches the ground: thrust carries {share:.0%} of its weight, and it does not fall"
    CALLED_LANDED = "the vehicle touches the ground: the autopilot has called it landed for {landed_s:.1f} s"
    NOT_LIFTED = "the vehicle stays on the ground: it is at {climbed_m:.2f} m above it, expected {wanted_m:.2f} m"
    TILT_SATURATED = "the tilt command has been at its limit of {most_deg:g} deg for {held_s:.1f} s"
    THROTTLE_SATURATED = "the throttle has been at its limit of {most:g} for {held_s:.1f} s"
    OTHER_VEHICLE = (
        "the vehicle is not the one of the model: the residual has been over {most_m_s2:g} m/s^2 for more than "
        "{longest_s:g} s, it is {size_m_s2:.2f} m/s^2, most of it {towards}"
    )
    CHANGED = "{change}"
    AS_MODELLED = "{name} as in the model again"
    NOT_FOLLOWED = "mission not followed: the position error was {error_m:.2f} m (RMS), allowed are {most_m:g} m"
    # --- the start ---
    POSTURE = "{tilt_deg:.1f} deg tilt, {speed_m_s:.2f} m/s, z = {height_m:.2f} m in the autopilot's frame"
    LEANS = "expected at most {most_deg:g} deg"
    MOVES = "expected at most {most_m_s:g} m/s"
    OTHER_DATUM = "height_datum: frame takes z = 0 for the ground, expected the vehicle there; or say takeoff"
    NOT_STANDING = "the vehicle does not stand on the ground: {posture}: {expected}"
    NOT_READY = "the autopilot is not ready to arm in {mode:mode}"
    NO_USABLE_STATE = "no usable state came from the autopilot in {waited_s:g} s: {problem}{texts:further}"
    ARMED_ALREADY = "the vehicle is armed already, expected it to stand disarmed on the ground"
    ARMED_BY_OTHERS = "somebody else armed the vehicle"
    NOT_STARTED = (
        "the autopilot did not get ready in {waited_s:g} s: armed is {armed}, mode is ",
        By("mode", {"": "unknown"}, "{mode}"),
        ", expected {expected}",
    )
    REFUSED = "{text}{texts:further}"
    NO_TAKE_OFF = "the autopilot did not take off in {waited_s:g} s"
    # --- who flies ---
    DISARMED = "the vehicle was disarmed"
    LEFT_OFFBOARD = "the autopilot left offboard for {mode:mode}"
    WENT_TO = "the autopilot went to {mode:mode}"
    RESTARTED = "the autopilot restarted"
    STALLED = "the control loop stalled for {stalled_s:.2f} s"
    STALLED_BEFORE = "the control loop stalled for {stalled_s:.2f} s, then {reason}"
    GONE = "the autopilot is gone: nothing comes from it"
    HEARD_AGAIN = "it is heard again"
    # --- the end ---
    COMPLETED = "completed"
    KNOWN = "known by now: {known:known}"
    FADED = "the compensator is beyond the heights of its data"
    UNCONFIRMED = "nothing shows that the autopilot lands: its failsafe acts when quadctl is gone"
    NOT_LANDED = "the autopilot did not land and disarm in {waited_s:g} s"
    LINK_NOT_BACK = "the link did not come back in {waited_s:g} s"
    GIVEN_BACK = "the mode is {mode} again, which nobody flies: its failsafe lands it when quadctl is gone"
    GONE_AT_END = "the autopilot is gone"


Reason: TypeAlias = Fact
reason = fact
