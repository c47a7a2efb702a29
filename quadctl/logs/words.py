"""The kinds of findings about a record, each with the template of its sentence: for terminal, page and report."""

from collections.abc import Iterable, Mapping
from enum import unique
from typing import TypeAlias

from quadctl.thrust_chain.ardupilot import ATMOSPHERES
from quadctl.thrust_chain.atmosphere import Atmosphere
from quadctl.words import By, Format, Kinds, When, Words

Span: TypeAlias = tuple[float, float]
"""Begin and end of a stretch of time, s on the log's clock; the same twice for an instant."""


def instants(times_s: Iterable[Span]) -> str:
    """Times, of stretches their begins: `3.1 s, 4.5 s`."""
    return ", ".join(f"{begin:.1f} s" for begin, _ in times_s)


def stretches(times_s: Iterable[Span]) -> str:
    """Times from and to: `from 3.1 to 4.5 s`."""
    return ", ".join(f"from {begin:.1f} to {end:.1f} s" for begin, end in times_s)


LIKELY = {
    "time in ms": "is time_s in milliseconds?",
    "time in us": "is time_s in microseconds?",
    "time in ns": "is time_s in nanoseconds?",
    "position in mm": "is the position in millimetres?",
    "position in cm": "is the position in centimetres?",
    "position in ft": "is the position in feet?",
    "velocity in ft/s": "is the velocity in feet per second?",
    "velocity in knots": "is the velocity in knots?",
    "velocity in km/h": "is the velocity in km/h?",
    "velocity in cm/s": "is the velocity in cm/s?",
    "not in metres and seconds": "are both in metres and seconds?",
    "one points down": "does one of them point down?",
    "one points the other way": "does one of them point the other way?",
    "angles in radians": "are roll_deg and pitch_deg in radians?",
    "motion in ft": "are position and velocity in feet?",
    "motion in cm": "are position and velocity in centimetres?",
    "motion in mm": "are position and velocity in millimetres?",
    "not in m/s and degrees": "are the velocity in m/s and the angle in degrees?",
    "wrong sign": "is its sign wrong (FRD: nose up and right side down are positive), or the yaw's?",
    "wrong sign of one": "is the sign of one of them wrong?",
    "rates in degrees": "is the rate in degrees per second, or the angle in radians?",
    "not in their units": "are both in their units?",
    "acceleration in g": "is the acceleration in g?",
    "acceleration not in m/s^2": "is it in m/s^2?",
    "accelerations not in m/s^2": "are they in m/s^2?",
    "not FRD": "is it FRD?",
}
"""Questions that name the likely cause of a contradiction."""

COMPENSATION = By(
    "of",
    {"voltage": "voltage compensation (MOT_BAT_VOLT_MAX = {volt_max:.4g})"},
    When(
        "density_ratio",
        (
            "density compensation (air of {density_ratio:.3f} of sea level",
            When("atmosphere", ", {atmosphere:atmosphere}"),
            ")",
        ),
        "density compensation",
    ),
)
"""Part of ArduPilot's way from thrust to output."""
ELSEWHERE = "rotor speeds are not read, thrust is taken from another signal"
DISAGREE = "velocity and accelerometer disagree ({by} m/s^2), and thrust and attitude agree with the "

_SIDES = (("ahead of", "behind"), ("right of", "left of"), ("below", "above"))


def _place(arm_m: Iterable[float]) -> str:
    """Place of a point beside another, from its coordinates forward, right and down, m."""
    ahead, right, below = (f"{abs(m):.2f} m {side[m < 0.0]}" for m, side in zip(arm_m, _SIDES, strict=True))
    return f"{ahead}, {right} and {below}"


_FORMATS: Mapping[str, Format] = {
    "instants": instants,
    "stretches": stretches,
    "ms": lambda s: f"{1000.0 * s:.0f}",
    "seconds": lambda times_s: ", ".join(f"{s:.2g} s" for s in times_s),
    "size": lambda value: f"{abs(value):.3g}",
    "most": lambda values: f"{max(values):.2g}",
    "place": _place,
    "values": lambda values: ", ".join(f"{name} = {value:.4g}" for name, value in values.items()),
    "ratios": lambda steps: ", ".join(f"{k:.3f} +- {1.96 * std:.3f} at {z_m:.2f} m" for z_m, k, std in steps),
    "compensations": lambda parts: " and ".join(_WORDS.say(COMPENSATION, part) for part in parts),
    "further": lambda parts: "".join(f", {_WORDS.say(COMPENSATION, part)}" for part in parts),
    "atmosphere": lambda name: ATMOSPHERES[Atmosphere(name)],
    "witness": {"imu": "the accelerometer", "thrust": "thrust and attitude"},
    "likely": LIKELY,
    "changes": lambda of: (
        f"the vehicle speeds up {of.removeprefix('speed ')}" if of.startswith("speed ") else f"{of} changes"
    ),
    "once": lambda of: "about once" if of.startswith("speed ") else "once",
}
_WORDS: Words = Words(_FORMATS)


@unique
class Kind(Kinds, words=_WORDS):
    """Kinds of findings, each with the template of its sentence, in which `spans` are the times; JSON has the name."""

    CUT_SHORT = By(
        "of",
        {
            "file": "the file ends in the middle, as after a crash: what is whole was read",
            "logger": "the file ends without what PX4's logger writes last: it was cut, or the power was",
        },
        "the last message is cut short and was left out",
    )
    LAST_LINE_CUT = "the last line ({line}) is cut short and was left out"
    DAMAGED = "the file is damaged: what could not be read was left out"
    DAMAGED_BYTES = (
        "{bytes} damaged bytes left out",
        By("first", {None: ""}, ", the first at byte {first}"),
    )
    DAMAGED_LINES = "{lines:count damaged line} left out (line {line}: {what})"
    LOST_BY_LOGGER = "PX4's logger lost data {times} times, {seconds:.2f} s together"
    SIDECAR_UNREADABLE = "{file} beside it is not a readable YAML mapping and was left out"
    NO_PARAMETERS = "has no parameters of the autopilot in {file}"
    COPY = When(
        "left_out",
        "{other} holds the same flight and is left out",
        "holds the same flight as {other}: only one of them tells anything",
    )
    READ_BY_MAP = "read by the map {file}"
    SEVENTEEN_COLUMNS = (
        "17 columns and no header: the last four were read as ",
        By(
            "as",
            {
                "throttle": "commanded attitude and throttle, not rotor speeds",
                "rpm": "rotor speeds, being too large for a throttle",
            },
        ),
    )
    UNKNOWN_COLUMN = "column '{column}' is not a flight log's and was left out{hint}"
    ABSENT_COLUMNS = "holds no {columns:list}"
    TOPIC_LEFT_OUT = "{topic} is left out: {read} holds more of the same"
    OTHER_SYSTEMS = "system {system} was read; others with positions were left out (system/component {others:list})"
    REBOOTED = "the autopilot booted {times} times: only the longest part was read ({messages} messages)"
    LEADING_ROWS = "{rows:count row} before the first known position left out (from {of} {number})"
    TIME_STANDS_STILL = (
        "{rows:count row} in which time does not increase left out, the first is {of} {number} (time_s = {time_s:g})"
    )
    MESSAGES_OUT_OF_TIME = "{left_out} of {messages} {source} messages left out: their time does not increase"
    INFINITE_VALUES = "{values:count infinite value} of {column} read as missing"
    IMPOSSIBLE_VALUES = "{values:count impossible value} of {column} (beyond {limit:g}) read as missing"
    NO_VALUES = "{channel} holds no values"
    NEVER_CHANGES = "constant in the whole log: {channels:list}"
    SPEEDS_ZERO = (
        "{source} ",
        When("several", "report", "reports"),
        " no rotor speeds: they are all zero",
    )
    THRUST_FROM = "without rotor speeds, thrust is taken from the {source}"
    NO_MOTOR_SIGNAL = "holds neither esc_status nor actuator_motors: thrust is known from the throttle command only"
    NOT_PULSES = "actuator_outputs are no pulse lengths in microseconds: not read as motor outputs"
    OUTPUT_CHAIN = When(
        "pulses_us",
        (
            "motor outputs are pulse lengths of actuator_outputs as shares of {pulses_us[0]:g} to {pulses_us[1]:g} us",
            When("bend", ", PX4's thrust curve (THR_MDL_FAC = {bend:g}) is removed"),
        ),
        When(
            "lacking",
            "motor outputs are shares of the PWM range, as the log lacks one of {lacking:list}: not proportional to "
            "thrust, as throttle_cmd should be",
            (
                "motor outputs are shares of the full thrust: ArduPilot's thrust curve ({curve:values})"
                "{removed:further} removed",
                When("kept", "; its {kept:compensations} cannot be removed, as the log lacks the measurement"),
            ),
        ),
    )
    BATTERY_SCALE = When(
        "removed",
        "PX4's scaling of outputs and thrust with the battery (MC_BAT_SCALE_EN) is removed",
        "PX4 scales its outputs with the battery (MC_BAT_SCALE_EN), which cannot be removed: no scale",
    )
    ANGLE_BOOST = "throttle_cmd holds ArduPilot's angle boost (ATC_ANGLE_BOOST = {value:g}), as it is flown"
    PARAMETER_CHANGED = "{name} changed from {before:g} to {after:g} at {spans:instants}"
    ABSENT_MOTORS = (
        "left out as 0 or empty throughout, of motors that a vehicle with {rotors} rotors does not have: {columns:list}"
    )
    OWN_CORRECTION = (
        "the autopilot corrects its outputs near the ground by itself: over the command they are "
        "{ratio_at_height_m:ratios} of what they are above {above_m:g} m, so switch that off, or take thrust from the "
        "outputs and not from throttle_cmd"
    )
    STATE_INVALID = When(
        "left_out",
        "PX4's estimator calls {columns:and} invalid in {share:.1%} of its messages ({flag} is false): left out there",
        (
            "ArduPilot's estimator did not call {columns:and} valid in {share:.1%} of its messages",
            When("while_armed", " while armed"),
            " ({flag}): they are read all the same",
        ),
    )
    RESET = (
        "the estimator reset its {of}",
        When("size", (" by {size:.3g} ", By("of", {"heading": "degrees", "velocity": "m/s"}, "m"))),
        " at {spans:instants}",
        By(
            "done",
            {
                "left out before": ": the directions before are wrong, what is before is left out",
                "turned before": ": the directions before are wrong, and turned by as much",
                "turned after": ": the directions after do not fit the motion, those before do; they are turned back",
            },
            ": it jumps there",
        ),
    )
    ATTITUDE_READ = (
        "the angles of the attitude are ",
        By(
            "order",
            {"inverse": "those of the inverse rotation"},
            "written in the order {order}, not z-y-x",
        ),
        ", as the body rates show: read so",
    )
    NO_HEADING = (
        "yaw_deg is ",
        When("course", "the course over the ground", "not the heading"),
        ": it turns otherwise than the body rates say in {share:.0%} of the time; the heading is taken from the gyro, "
        "and its direction from the motion",
    )
    HEADING_OFF = (
        "the heading does not fit the motion: it shows {by_deg:+.1f} +- {std_deg:.1f} degrees more than that (compass, "
        "or the axes of a motion capture), and is turned back"
    )
    HEADING_DRIFTS = (
        "the heading drifts against the motion by {by_deg_s:+.3f} +- {std_deg_s:.3f} degrees per second, and is turned "
        "back"
    )
    LANE_SWITCH = (
        "the autopilot changed to another core of its estimator at {spans:instants}: the state is read from the one "
        "that flew"
    )
    REJECTED = "the estimator rejected its measurement of {of} {spans:stretches}: left out there"
    GPS_LOST = "the GPS had no fix {spans:stretches}: left out there"
    ON_GROUND = "the vehicle stands on the ground {spans:stretches}, rotors working: left out there"
    GROUND_MOVED = (
        "the ground is at {before_m:.2f} m before a flight and at {after_m:.2f} m after it: a drift or reset of the "
        "height, or another ground"
    )
    ENDS_IN_AIR = (
        "the log ends in the air, at {spans:instants}: it was cut short, or the power failed, and the flight went on"
    )
    OUT_OF_CONTROL = (
        "out of control from {spans[0][0]:.1f} s on (",
        By(
            "why",
            {
                "upside down": "the vehicle leans by more than 90 degrees",
                "attitude not as commanded": "its {angle} is off the command by up to {error_deg:.0f} degrees",
                "motor at its limit": "motor {motor} stays at its {limit} output",
                "said by the autopilot": "the autopilot says '{message}'",
            },
        ),
        "): nothing is used from then on",
    )
    DEAD_CHANNEL = By(
        "why",
        {
            "no battery": "{channel} reads {value:.2g} V in flight, which is no battery: not read",
            "not measured": f"{{channel}} is not measured in flight: {ELSEWHERE}",
            "stands": f"{{channel}} stands at {{value:.0f}} in flight while the other speeds change: {ELSEWHERE}",
        },
        f"{{channel}} is frozen at {{value:.0f}} in flight while the other speeds change: {ELSEWHERE}",
    )
    FROZEN_ROTOR = (
        "the speed of rotor {rotor} stays the same {spans:stretches} while those of the others change: this time is "
        "left out"
    )
    SPIKE = "the {of} jumps away and back by up to {largest:size} {unit} at {spans:instants}: left out there"
    SPIKES = "{updates} {of} that jump away and back, faster than a multirotor can move, are left out"
    IN_FLIGHT = "{seconds:.0f} s of {of_seconds:.0f} s are flight; the ground, take-off and landing are left out"
    GAPS = "{seconds:.1f} s without new values (gaps over {longest_s:.1f} s) are left out"
    CLOCK_JUMP = "the clock jumps by {by_s:seconds} at {spans:instants}, as the positions on both sides show"
    INTERPOLATED = (
        "{channel}: rows at {rows_hz:.0f} Hz are interpolated between packets of at most {at_most_hz:.0f} Hz; only "
        "packets count"
    )
    EXTRAPOLATED = (
        "{channel} follows a straight line {spans:stretches}: drawn by a program, not measured; left out there"
    )
    DELAY = By(
        "of",
        {
            "thrust": "the rotors' signal has a clock of its own: it comes {least_s:ms} to {most_s:ms} ms after the "
            "motion, and is put on its clock"
        },
        (
            "the ",
            By("of", {"imu": "body rates and accelerometer"}, "body rates"),
            " come ",
            When("wanders", "{least_s:ms} to {most_s:ms}", "{median_s:ms}"),
            " ms after the {behind}",
            When("wanders", ", and wander within the flight"),
            By(
                "moved",
                {
                    "attitude": ", and so does the motion: the attitude is early (is it a setpoint?), and is put on "
                    "their clock"
                },
                ": shifted to its clock; the delay of the rotors' signal is less certain",
            ),
        ),
    )
    BELOW_REST = (
        "the vehicle flies at {lowest_m:.2f} m, below the {rest_m:.2f} m at which it stands: heights near the ground "
        "are wrong (a barometer in the wash of the rotors, for example), and tell no ground effect"
    )
    LEVER_ARM = (
        "position and velocity are those of a point {arm_m:place} the centre of mass (each +- {std_m:most} m; an "
        "antenna, a marker, the autopilot): what its turning adds is taken away"
    )
    LEVEL_STEP = (
        "the attitude's level changes at {spans:instants} by {roll_deg:.1f} degrees in roll and {pitch_deg:.1f} in "
        "pitch, and the vehicle does not speed up to that side: the board or a marker slipped; what is {left_out} is "
        "left out"
    )
    WITNESSES_DISAGREE = By(
        "odd",
        {
            "imu": f"{DISAGREE}velocity: the accelerometer is not read",
            "attitude": f"{DISAGREE}accelerometer, which follows the thrust: an error of the attitude, or of the "
            "estimated velocity; the acceleration is taken from the accelerometer there",
        },
        f"{DISAGREE}accelerometer: an error of the estimated velocity, that of a barometer, for example; the "
        "acceleration is taken from the accelerometer there",
    )
    HEIGHT_ERROR = By(
        "witness",
        {
            "range finder": "the estimated height errs near the ground, by up to {largest_m:.2g} m, as a barometer "
            "does in the rotors' air, against the range finder: this is taken away, in the climb rate too; `quadctl "
            "diagnose --sensors` tells its parameters"
        },
        "the estimated height errs with the square of the speed, by up to {largest_m:.2g} m, as that of a barometer "
        "does in moving air, and the climb rate with it ({difference_m_s2:.2g} m/s^2 beyond {witness:witness}): this "
        "is taken away; `quadctl diagnose --sensors` tells its coefficients, with a range finder or GPS's climb rate",
    )
    ANOTHER_FACTOR = "{of:changes} {factor:.3g} times as much as {by} says, expected {of:once}: {likely:likely}"
    SWAPPED = By(
        "of",
        {
            "position": "x_m changes as vy_m_s says, or y_m as vx_m_s, and not by their own, expected x north and y "
            "east in both"
        },
        "the vehicle speeds up forward by its roll_deg or to the right by its pitch_deg, expected the other way: are "
        "roll and pitch, or x and y, swapped, or is yaw_deg wrong?",
    )
    LEANS = (
        "the vehicle leans by {lean_deg:.0f} deg half of the time, expected less than {most_deg:.0f}: is the attitude "
        "in another frame, or its quaternion in another order?"
    )
    NOT_GRAVITY = By(
        "likely",
        {
            "not FRD": "imu_z_m_s2 is {size_m_s2:.3g} in the middle, expected about -9.8 in hover: {likely:likely}",
        },
        "imu_x_m_s2, imu_y_m_s2, imu_z_m_s2 have a median length of {size_m_s2:.3g} m/s^2, expected about 9.8, as in "
        "hover: {likely:likely}",
    )
    GRAVITY_TURNED = By(
        "angle_deg",
        {
            None: "the accelerometer, turned by the attitude, reads {size_m_s2:.3g} m/s^2 on average, expected 9.8 "
            "upward: is the attitude's frame or the quaternion's order another?"
        },
        "the accelerometer, turned by the attitude, points {angle_deg:.0f} deg away from up on average, expected about "
        "0: is the frame of one of them, or the quaternion's order, another?",
    )
    STANDS_STILL = "{channel} is {value:g} throughout while {while_changes} changes, expected nan where it is not known"
    ROTOR_UNKNOWN = By(
        "why",
        {
            "no values": "{rotor} holds no values while {known} does, expected the speeds of all rotors",
            "silent": "{rotor} is {rpm:.0f} for most of the log while other rotors turn, expected all of them to",
        },
        "{rotor} is {rpm:.0f} throughout while the speeds of other rotors change",
    )
    LACKS = By(
        "of",
        {
            "thrust": "it holds neither rotor speeds nor motor outputs nor a command of throttle or thrust: thrust is "
            "unknown"
        },
        ("it holds no ", When("column", "values of "), "{of}"),
    )
    TOO_SLOW = (
        "{channel}: ",
        When("rate_hz", "{rate_hz:.2f} updates per second", "never changes"),
        " in flight, an analysis needs at least {least_hz:g} per second",
    )
    BELOW_GROUND = "z_m falls at the take-off and stays below the ground in flight: are z_m and vz_m_s up?"
    TOO_SHORT = "about {seconds:.0f} s of usable flight, an analysis needs at least {least_s:.0f} s"
    WEIGHT_DOUBT = (
        "by the {source} the rotors of '{vehicle}' give {factor:.2g} times the thrust that carries its {mass_kg:g} kg: "
        "is it the vehicle that flew, with this mass and these propellers{line}?"
    )
    FORCE_BY_ACCELEROMETER = (
        "the force on the body is that of the accelerometer, so that errors of motion capture's attitude do not turn "
        "it; the velocity checks it"
    )
    VELOCITY_SCALE = (
        "{position} changes {factor:.2f} times as fast as {velocity} says: a clock, a unit or an estimator is off, and "
        "the acceleration may be wrong by as much"
    )
