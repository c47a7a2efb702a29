"""Facts about a flight that is to begin, each kind with the template of its words."""

from collections.abc import Mapping, Sequence
from enum import unique

from quadctl.words import By, Kinds, When, Words

_WHERE = "at {time_s:.1f} s ({phase})"
LAG_MAY_DIFFER = "the lag may differ: fly excitation and run `quadctl fit` again"


def _shares(until: Mapping[str, float]) -> str:
    return " and ".join(f"{name} to {100.0 * share:g} %" for name, share in until.items())


def _metres(values: Sequence[float]) -> str:
    return " and ".join(f"{value:.2f} m" for value in values)


_WORDS = Words(
    {
        "shares": _shares,
        "metres": _metres,
        "further": lambda facts: "; ".join(map(str, facts)),
        "axis": lambda axis: ", ".join(f"{part:.3f}" for part in axis),
    }
)


@unique
class Kind(Kinds, words=_WORDS):
    TOLD = "{text}"
    """Words of another part, of a file or of the autopilot."""
    SEVERAL = "{facts:further}"
    BOTH = "{facts:and}"
    # --- mission and compensator ---
    MISSION = (
        "{name}, {duration_s:.0f} s",
        By("time_scale", {1.0: ""}, " (times {time_scale:g}-fold)"),
        " in {phases} phases, heights {lowest_m:.2f} to {highest_m:.2f} m within the mission's limits of "
        "{min_z_m:g} to {max_z_m:g} m",
        When("until", "; it ends earlier once the flight knows {until:shares}"),
    )
    NO_COMPENSATOR = "none"
    COMPENSATOR = "{effects:list}, rotor heights {low_m:.2f} to {high_m:.2f} m"
    FITTED_HEIGHTS = "{effect} was fitted to rotor heights of {low_m:.2f} to {high_m:.2f} m"
    BEYOND_FITTED = "the mission's limits go beyond them, where it fades out within {fade_m:g} m"
    RATIO = "thrust ratio by the model {low:.3f} to {high:.3f} in the mission, limited to {least:g} to {most:g}"
    RATIO_CUT = "it asks for more than the limit"
    SURFACES = "{names:list}"
    PLACE_UNKNOWN = "the mission does not say over which of them it is ({known:list}): the mean of all is compensated"
    SURFACES_UNKNOWN = "the model knows {known:list}, not {unknown:list}: there the mean of all is compensated"
    # --- limits ---
    CLEARANCE = "lowest rotor tip {gap_m:.2f} m above the ground (z = {z_m:.2f} m, {tilt_deg:.0f} deg tilt)"
    TOUCHES_GROUND = "it touches the ground"
    BELOW_REST = "z = {z_m:.2f} m is below rest_height_m = {rest_m:g}, where the vehicle stands"
    LITTLE_CLEARANCE = "expected {least_m:g} m or more"
    CEILING = "rotors up to {highest_m:.2f} m, ceiling at {ceiling_m:g} m"
    NEAR_CEILING = "expected a rotor radius ({radius_m:g} m) or more below it"
    GUARD_ABOVE_CEILING = "the guard ends a climb at z = {guard_m:g} m (max_z_m + margin_m), which is above it"
    FENCE = "{farthest_m:.2f} m from take-off at most; beyond {fence_m:g} m quadctl lands"
    SPEED = (
        "up to {top_m_s:.2f} m/s (climb {climb_m_s:.2f}, descent {descent_m_s:.2f}, setpoint steps not counted) "
        + _WHERE
        + "; above {most_m_s:g} m/s quadctl lands"
    )
    SPEED_BEYOND_GUARD = "the guard would end the mission"
    FALLS_BEHIND = "the controller flies at most {name} = {limit_m_s:g} m/s and falls behind {speed_m_s:.2f} m/s"
    NEAR_SPEED_GUARD = "closer than {margin:.0%} to the guard"
    TILT = (
        "up to {top_deg:.0f} deg " + _WHERE + ", controller's limit {limit_deg:g} deg; above {guard_deg:g} deg quadctl "
        "hands over to the autopilot"
    )
    TILT_BEYOND_GUARD = "the controller may lean further than the guard allows, expected a guard above its limit"
    LEANS_LESS = "the controller leans less and falls behind"
    THRUST = (
        "up to {thrust_n:.1f} N, {share:.0%} of the most that the rotors give, with throttle {throttle:.2f} "
        + _WHERE
        + "; hover needs {hover:.0%} of the most"
    )
    TOO_WEAK = "the rotors give {most_n:.1f} N, max_throttle is {max_throttle:g}"
    LITTLE_THRUST = "more than {margin:.0%} leaves little for attitude control"
    GUARDS_OFF = "turned off: {names:list}"
    FOR_THE_BENCH = "each is 0, which is for tests without propellers"
    ENDURANCE = (
        "{duration_s:.0f} s of flight",
        When("endurance_s", ", the vehicle hovers for {endurance_s:g} s"),
        When("least_v", ", lands below {least_v:g} V"),
    )
    DOES_NOT_LAST = "it does not last"
    LITTLE_BATTERY = "less than {margin:.0%} is left"
    VOLTAGE_UNGUARDED = "no guard on the voltage (guards.min_battery_v is 0)"
    ENDURANCE_UNKNOWN = "the hover time on a full battery is not known (endurance_s in the vehicle file)"
    # --- rate and lag of the attitude ---
    RATE = (
        "the thrust axis turns by up to {rate_deg_s:.0f} deg/s " + _WHERE,
        By("left_m", {None: ""}, ", the attitude's answer leaves up to {left_m:.2f} m"),
    )
    BEYOND_TOLERANCE = "expected at most limits.tolerance_m = {most_m:g} m"
    RATE_LIMIT = "{name} is {most_deg_s:g} deg/s, the mission needs {needed_deg_s:.0f}"
    TURNS_SLOWER = "the autopilot turns slower, and the vehicle falls behind: --time-scale slows the mission"
    NOT_AHEAD = "look_ahead is false: the reference is fed forward at its own time"
    AHEAD = "the force to the side follows {lag_s:.2f} s later, and the reference is looked at ahead"
    NO_RESPONSE = (
        "lag of the attitude not known ('{vehicle}' has no attitude_response), so no look-ahead: the vehicle follows "
        "late; "
        "`quadctl fit` finds the lag in a log of the mission `excitation`"
    )
    NO_DRAG = "lag {lag_s:.2f} s, but no drag in the model: no look-ahead, so the vehicle follows late"
    LAG_NOT_SHOWN = "{log} does not show the lag"
    TOO_CALM = "expected 15 s in the air that lean both ways, as excitation does"
    LAG_SHOWN = (
        "attitude lag {lag_s:.2f} s",
        When("interval_s", " [{interval_s[0]:.2f}, {interval_s[1]:.2f}]"),
        " in {log}, configured ",
        By(
            "configured_s",
            {None: "none: look-ahead is off; `quadctl fit` writes it into the model file"},
            "{configured_s:.2f}",
        ),
    )
    LAG_DIFFERS = LAG_MAY_DIFFER
    NO_PARAMETERS_IN_LOG = "{log} does not hold the parameters on which the lag depends"
    PARAMETER_CHANGED = f"{{name}} was {{was:g}} in {{log}}, is {{now:g}}: {LAG_MAY_DIFFER}"
    PARAMETERS_KEPT = "{parameters} parameters on which the lag depends are as in {log}"
    # --- lateral force ---
    FULL = "full"
    LATERAL = "full, lateral force up to {reach_n:.1f} N in hover ({share:.0%} of the weight)"
    UPRIGHT = "lateral force is asked of upright rotors, expected actuation: tilt, as '{vehicle}' tilts none"
    TOO_FEW_DIRECTIONS = (
        "the rotors of '{vehicle}' give force and moment in {rank} independent directions, expected 6 (neighbours that "
        "cant to opposite sides), or actuation: tilt"
    )
    NO_RESERVE = "hover takes all that the rotors give"
    FULL_ON = "full on {autopilot}"
    NO_LATERAL_SETPOINT = (
        "it has no setpoint of lateral force and would fly without it, expected PX4, or actuation: tilt"
    )
    ALLOCATION = "control allocation of the autopilot"
    AXES_UNTOLD = "it does not tell {name}, expected the axes of all {rotors} rotors"
    NO_MULTIROTOR = "CA_AIRFRAME is {airframe:g}, expected 0 (multirotor), whose rotors are mixed by their axes"
    OTHER_AXIS = (
        "{name}, _AY, _AZ are {found:axis}, expected {expected:axis}, the axis of rotor {rotor} of '{vehicle}': it "
        "would mix lateral force for other rotors"
    )
    # --- the computer ---
    RIGHTS = (
        When("real_time_priority", "", "no "),
        "real-time priority, ",
        When("locked_memory", "", "no "),
        "locked memory",
    )
    DELAYS = "a busy computer delays ticks; {remedy}"
    # --- the autopilot ---
    PARAMETER = "{said}"
    """`name`, `value`, and what the firmware's table says of it."""
    NOT_MET = "expected {expected:.7g} (--set-params does it): {because}"
    LEFT_BEHIND = (
        "{name} = {set_to:.7g} was set for an earlier flight, which ended without restoring it: it was {was:.7g}, "
        "--restore-params restores it"
    )
    OF_ANOTHER = "{path} keeps old values for another vehicle too ({vehicle}): connect it to restore them"
    NONE_TOLD = "the autopilot tells none of them"
    UNTOLD = "the autopilot does not tell it"
    MESSAGES = "{part} at {rate_hz:.0f} Hz, up to {oldest_ms:.0f} ms old"
    NONE_CAME = "none came"
    TOO_OLD = "the guard hands over at max_state_age_s = {most_s:g}"
    TOO_RARE = "control runs at {wanted_hz:g} Hz"
    ROTOR_SPEEDS = "rotor speeds at {rate_hz:.0f} Hz"
    NO_ROTOR_SPEEDS = "the lab will have to take thrust from the throttle"
    ALL_ZERO = "all are zero, so it will show when the motors turn if they are measured"
    ESTIMATOR = (
        "attitude, velocity and position",
        When("std_m", ", standard deviation {std_m:metres}"),
    )
    NOT_LANDED = "the autopilot does not think that it has landed"
    MODE = (When("mode", "{mode}", "unknown"), ", ", When("armed", "armed", "disarmed"))
    ARMED = "expected a vehicle that is disarmed"
    NOT_READY = ("its own checks do not pass", When("reasons", " ({reasons:further})"), ": it would not arm")
    READINESS_UNTOLD = "in this mode it does not say if it would arm: choose another mode"
    CHECKS_OFF = "its own checks before arming are off (ARMING_CHECK is 0): it arms whatever it would object to"
    NO_REMOTE = "the autopilot receives no remote control: nobody can take the vehicle with one"
    VOLTAGE = ("{battery_v:.2f} V", By("left_percent", {None: ""}, ", {left_percent:.0f} % left"))
    VOLTAGE_UNKNOWN = "voltage unknown"
    GUARD_NEEDS_IT = "guards.min_battery_v needs it"
    TOO_LOW = "expected {least_v:g} V or more"
