"""The sentence of each finding about a record: one table, for the terminal, the page and the report."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, TypeAlias

from quadctl.logs.findings import Finding, Kind, Span
from quadctl.thrust_chain.ardupilot import ATMOSPHERES
from quadctl.thrust_chain.atmosphere import Atmosphere

_Figures: TypeAlias = Mapping[str, Any]
_Words: TypeAlias = "str | Callable[[_Figures, Sequence[Span]], str]"


def worded(found: Finding) -> str:
    """Sentence of a finding, without the log's name, a capital and a full stop."""
    words = WORDS[found.kind]
    return words.format(**found.figures) if isinstance(words, str) else words(found.figures, found.times_s)


def count(n: int, what: str) -> str:
    """Number of things: `1 row`, `2 rows`."""
    return f"{n} {what}{'s' if n != 1 else ''}"


def instants(times_s: Iterable[Span]) -> str:
    """Times, of stretches their begins: `3.1 s, 4.5 s`."""
    return ", ".join(f"{begin:.1f} s" for begin, _ in times_s)


def stretches(times_s: Iterable[Span]) -> str:
    """Times from and to: `from 3.1 to 4.5 s`."""
    return ", ".join(f"from {begin:.1f} to {end:.1f} s" for begin, end in times_s)


def _seventeen(figures: _Figures, _: Sequence[Span]) -> str:
    read_as = {
        "throttle": "commanded attitude and throttle, not rotor speeds",
        "rpm": "rotor speeds, being too large for a throttle",
    }
    return f"17 columns and no header: the last four were read as {read_as[figures['as']]}"


def _impossible(figures: _Figures, _: Sequence[Span]) -> str:
    values = count(figures["values"], "impossible value")
    return f"{values} of {figures['column']} (beyond {figures['limit']:g}) read as missing"


def _invalid(figures: _Figures, _: Sequence[Span]) -> str:
    columns, share = " and ".join(figures["columns"]), figures["share"]
    if figures["left_out"]:
        return (
            f"PX4's estimator calls {columns} invalid in {share:.1%} of its messages ({figures['flag']} is false): "
            "left out there"
        )
    armed = " while armed" if figures["while_armed"] else ""
    return (
        f"ArduPilot's estimator did not call {columns} valid in {share:.1%} of its messages{armed} "
        f"({figures['flag']}): they are read all the same"
    )


def _output_chain(figures: _Figures, _: Sequence[Span]) -> str:
    if "pulses_us" in figures:
        low, high = figures["pulses_us"]
        bend = f", PX4's thrust curve (THR_MDL_FAC = {figures['bend']:g}) is removed" if figures["bend"] else ""
        return f"motor outputs are pulse lengths of actuator_outputs as shares of {low:g} to {high:g} us{bend}"
    if figures["lacking"]:
        return (
            f"motor outputs are shares of the PWM range, as the log lacks one of {', '.join(figures['lacking'])}: not "
            "proportional to thrust, as throttle_cmd should be"
        )
    curve = ", ".join(f"{name} = {value:.4g}" for name, value in figures["curve"].items())
    removed = [f"thrust curve ({curve})", *map(_compensation, figures["removed"])]
    kept = [_compensation(name) for name in figures["kept"]]
    lacking = f"; its {' and '.join(kept)} cannot be removed, as the log lacks the measurement" if kept else ""
    return f"motor outputs are shares of the full thrust: ArduPilot's {', '.join(removed)} removed{lacking}"


def _compensation(of: Mapping[str, Any]) -> str:
    if of["of"] == "voltage":
        return f"voltage compensation (MOT_BAT_VOLT_MAX = {of['volt_max']:.4g})"
    ratio = of.get("density_ratio")
    if ratio is None:
        return "density compensation"
    by = f", {ATMOSPHERES[Atmosphere(of['atmosphere'])]}" if of.get("atmosphere") else ""
    return f"density compensation (air of {ratio:.3f} of sea level{by})"


def _battery_scale(figures: _Figures, _: Sequence[Span]) -> str:
    if figures["removed"]:
        return "PX4's scaling of outputs and thrust with the battery (MC_BAT_SCALE_EN) is removed"
    return "PX4 scales its outputs with the battery (MC_BAT_SCALE_EN), which cannot be removed: no scale"


def _own_correction(figures: _Figures, _: Sequence[Span]) -> str:
    steps = ", ".join(
        f"{ratio:.3f} +- {1.96 * error:.3f} at {height:.2f} m" for height, ratio, error in figures["ratio_at_height_m"]
    )
    return (
        f"the autopilot corrects its outputs near the ground by itself: over the command they are {steps} of what they "
        f"are above {figures['above_m']:g} m, so switch that off, or take thrust from the outputs and not from "
        "throttle_cmd"
    )


def _frozen_rotor(figures: _Figures, times_s: Sequence[Span]) -> str:
    return (
        f"the speed of rotor {figures['rotor']} stays the same {stretches(times_s)} while those of the others change: "
        "this time is left out"
    )


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


def _another_factor(figures: _Figures, _: Sequence[Span]) -> str:
    of, factor = figures["of"], f"{figures['factor']:.3g} times as much as {figures['by']} says"
    if of.startswith("speed "):
        what = f"the vehicle speeds up {of.removeprefix('speed ')} {factor}, expected about once"
    else:
        what = f"{of} changes {factor}, expected once"
    return f"{what}: {LIKELY[figures['likely']]}"


def _swapped(figures: _Figures, _: Sequence[Span]) -> str:
    if figures["of"] == "position":
        return "x_m changes as vy_m_s says, or y_m as vx_m_s, and not by their own, expected x north and y east in both"
    return (
        "the vehicle speeds up forward by its roll_deg or to the right by its pitch_deg, expected the other way: are "
        "roll and pitch, or x and y, swapped, or is yaw_deg wrong?"
    )


def _not_gravity(figures: _Figures, _: Sequence[Span]) -> str:
    size, likely = figures["size_m_s2"], LIKELY[figures["likely"]]
    if figures["likely"] == "not FRD":
        return f"imu_z_m_s2 is {size:.3g} in the middle, expected about -9.8 in hover: {likely}"
    names = "imu_x_m_s2, imu_y_m_s2, imu_z_m_s2"
    return f"{names} have a median length of {size:.3g} m/s^2, expected about 9.8, as in hover: {likely}"


def _gravity_turned(figures: _Figures, _: Sequence[Span]) -> str:
    if "angle_deg" in figures:
        return (
            f"the accelerometer, turned by the attitude, points {figures['angle_deg']:.0f} deg away from up on "
            "average, expected about 0: is the frame of one of them, or the quaternion's order, another?"
        )
    return (
        f"the accelerometer, turned by the attitude, reads {figures['size_m_s2']:.3g} m/s^2 on average, expected 9.8 "
        "upward: is the attitude's frame or the quaternion's order another?"
    )


def _rotor_unknown(figures: _Figures, _: Sequence[Span]) -> str:
    rotor = figures["rotor"]
    if figures["why"] == "no values":
        return f"{rotor} holds no values while {figures['known']} does, expected the speeds of all rotors"
    if figures["why"] == "silent":
        return f"{rotor} is {figures['rpm']:.0f} for most of the log while other rotors turn, expected all of them to"
    return f"{rotor} is {figures['rpm']:.0f} throughout while the speeds of other rotors change"


def _lacks(figures: _Figures, _: Sequence[Span]) -> str:
    if figures["of"] == "thrust":
        return "it holds neither rotor speeds nor motor outputs nor a command of throttle or thrust: thrust is unknown"
    return f"it holds no {'values of ' if figures['column'] else ''}{figures['of']}"


def _too_slow(figures: _Figures, _: Sequence[Span]) -> str:
    rate = f"{figures['rate_hz']:.2f} updates per second" if figures["rate_hz"] > 0.0 else "never changes"
    return f"{figures['channel']}: {rate} in flight, an analysis needs at least {figures['least_hz']:g} per second"


def _dead_channel(figures: _Figures, _: Sequence[Span]) -> str:
    name, value = figures["channel"], figures["value"]
    if figures["why"] == "no battery":
        return f"{name} reads {value:.2g} V in flight, which is no battery: not read"
    instead = "rotor speeds are not read, thrust is taken from another signal"
    if figures["why"] == "not measured":
        return f"{name} is not measured in flight: {instead}"
    how = "stands at" if figures["why"] == "stands" else "is frozen at"
    return f"{name} {how} {value:.0f} in flight while the other speeds change: {instead}"


def _spike(figures: _Figures, times_s: Sequence[Span]) -> str:
    size = f"{abs(figures['largest']):.3g} {figures['unit']}"
    return f"the {figures['of']} jumps away and back by up to {size} at {instants(times_s)}: left out there"


def _reset(figures: _Figures, times_s: Sequence[Span]) -> str:
    sizes = [abs(size) for size in figures.get("by", []) if size]
    unit = {"heading": "degrees", "velocity": "m/s"}.get(figures["of"], "m")
    by = f" by {max(sizes):.3g} {unit}" if sizes else ""
    after = {
        "left out before": ": the directions before are wrong, what is before is left out",
        "turned before": ": the directions before are wrong, and turned by as much",
        "turned after": ": the directions after do not fit the motion, those before do; they are turned back",
    }.get(figures.get("done", ""), ": it jumps there")
    return f"the estimator reset its {figures['of']}{by} at {instants(times_s)}{after}"


def _attitude_read(figures: _Figures, _: Sequence[Span]) -> str:
    order = figures["order"]
    found = "those of the inverse rotation" if order == "inverse" else f"written in the order {order}, not z-y-x"
    return f"the angles of the attitude are {found}, as the body rates show: read so"


def _no_heading(figures: _Figures, _: Sequence[Span]) -> str:
    what = "the course over the ground" if figures["course"] else "not the heading"
    return (
        f"yaw_deg is {what}: it turns otherwise than the body rates say in {figures['share']:.0%} of the time; the "
        "heading is taken from the gyro, and its direction from the motion"
    )


def _out_of_control(figures: _Figures, times_s: Sequence[Span]) -> str:
    why = {
        "upside down": "the vehicle leans by more than 90 degrees",
        "attitude not as commanded": "its {angle} is off the command by up to {error_deg:.0f} degrees",
        "motor at its limit": "motor {motor} stays at its {limit} output",
        "said by the autopilot": "the autopilot says '{message}'",
    }[figures["why"]].format(**figures)
    return f"out of control from {times_s[0][0]:.1f} s on ({why}): nothing is used from then on"


def _delay(figures: _Figures, _: Sequence[Span]) -> str:
    least, most = 1000.0 * figures["least_s"], 1000.0 * figures["most_s"]
    if figures["of"] == "thrust":
        return (
            f"the rotors' signal has a clock of its own: it comes {least:.0f} to {most:.0f} ms after the motion, and "
            "is put on its clock"
        )
    what = "body rates and accelerometer" if figures["of"] == "imu" else "body rates"
    change = f"{least:.0f} to {most:.0f} ms" if most - least > 10.0 else f"{1000.0 * figures['median_s']:.0f} ms"
    wander = ", and wander within the flight" if most - least > 10.0 else ""
    if figures.get("moved") == "attitude":
        return (
            f"the {what} come {change} after the {figures['behind']}{wander}, and so does the motion: the attitude is "
            "early (is it a setpoint?), and is put on their clock"
        )
    return (
        f"the {what} come {change} after the {figures['behind']}{wander}: put on its clock; the rotors' signal comes "
        "by a way of its own, which nothing checks as closely"
    )


def _lever_arm(figures: _Figures, _: Sequence[Span]) -> str:
    sides = (("ahead of", "behind"), ("right of", "left of"), ("below", "above"))
    ahead, right, below = (
        f"{abs(arm):.2f} m {side[arm < 0.0]}" for arm, side in zip(figures["arm_m"], sides, strict=True)
    )
    return (
        f"position and velocity are those of a point {ahead}, {right} and {below} the centre of mass (each +- "
        f"{max(figures['std_m']):.2g} m; an antenna, a marker, the autopilot): what its turning adds is taken away"
    )


def _disagree(figures: _Figures, _: Sequence[Span]) -> str:
    axes = ", ".join(
        f"{axis} by {size:.2g}" for axis, size in zip(figures["axes"], figures["difference_m_s2"], strict=True)
    )
    if figures["odd"] == "imu":
        return (
            f"velocity and accelerometer disagree ({axes} m/s^2), and thrust and attitude side with the velocity: the "
            "accelerometer is not read"
        )
    return (
        f"velocity and accelerometer disagree ({axes} m/s^2), and thrust and attitude side with the accelerometer: an "
        "error of the estimated velocity (along up that of a barometer, for example); the acceleration is taken from "
        "the accelerometer there"
    )


def _height_error(figures: _Figures, _: Sequence[Span]) -> str:
    if figures["witness"] == "range finder":
        return (
            f"the estimated height errs near the ground, by up to {figures['largest_m']:.2g} m, as a barometer does in "
            "the rotors' air, against the range finder: this is taken away, in the climb rate too; `quadctl diagnose "
            "--sensors` tells its parameters"
        )
    witness = {"imu": "the accelerometer", "thrust": "thrust and attitude"}[figures["witness"]]
    return (
        f"the estimated height errs with the square of the speed, by up to {figures['largest_m']:.2g} m, as that of a "
        f"barometer does in moving air, and the climb rate with it ({figures['difference_m_s2']:.2g} m/s^2 beyond "
        f"{witness}): this is taken away; `quadctl diagnose --sensors` tells its coefficients, with a range finder or "
        "GPS's climb rate"
    )


CUT_SHORT = {
    "message": "the last message is cut short and was left out",
    "file": "the file ends in the middle, as after a crash: what is whole was read",
    "logger": "the file ends without what PX4's logger writes last: it was cut, or the power was",
}
"""Sentences on a file that ends early, by what has no end."""

WORDS: dict[Kind, _Words] = {
    Kind.CUT_SHORT: lambda f, _: CUT_SHORT[f.get("of", "message")],
    Kind.LAST_LINE_CUT: "the last line ({line}) is cut short and was left out",
    Kind.DAMAGED: "the file is damaged: what could not be read was left out",
    Kind.DAMAGED_BYTES: lambda f, _: (
        f"{f['bytes']} damaged bytes left out" + (f", the first at byte {f['first']}" if "first" in f else "")
    ),
    Kind.DAMAGED_LINES: lambda f, _: f"{count(f['lines'], 'damaged line')} left out (line {f['line']}: {f['what']})",
    Kind.LOST_BY_LOGGER: "PX4's logger lost data {times} times, {seconds:.2f} s together",
    Kind.SIDECAR_UNREADABLE: "{file} beside it is not a readable YAML mapping and was left out",
    Kind.NO_PARAMETERS: "has no parameters of the autopilot in {file}",
    Kind.COPY: lambda f, _: (
        f"{f['other']} holds the same flight and is left out"
        if f["left_out"]
        else f"holds the same flight as {f['other']}: only one of them tells anything"
    ),
    Kind.READ_BY_MAP: "read by the map {file}",
    Kind.SEVENTEEN_COLUMNS: _seventeen,
    Kind.UNKNOWN_COLUMN: "column '{column}' is not a flight log's and was left out{hint}",
    Kind.ABSENT_COLUMNS: lambda f, _: f"holds no {', '.join(f['columns'])}",
    Kind.TOPIC_LEFT_OUT: "{topic} is left out: {read} holds more of the same",
    Kind.OTHER_SYSTEMS: lambda f, _: (
        f"system {f['system']} was read; others with positions were left out (system/component "
        f"{', '.join(f['others'])})"
    ),
    Kind.REBOOTED: "the autopilot booted {times} times: only the longest part was read ({messages} messages)",
    Kind.LEADING_ROWS: lambda f, _: (
        f"{count(f['rows'], 'row')} before the first known position left out (from {f['of']} {f['number']})"
    ),
    Kind.TIME_STANDS_STILL: lambda f, _: (
        f"{count(f['rows'], 'row')} in which time does not increase left out, the first is {f['of']} {f['number']} "
        f"(time_s = {f['time_s']:g})"
    ),
    Kind.MESSAGES_OUT_OF_TIME: "{left_out} of {messages} {source} messages left out: their time does not increase",
    Kind.INFINITE_VALUES: lambda f, _: f"{count(f['values'], 'infinite value')} of {f['column']} read as missing",
    Kind.IMPOSSIBLE_VALUES: _impossible,
    Kind.NO_VALUES: "{channel} holds no values",
    Kind.NEVER_CHANGES: lambda f, _: f"never change: {', '.join(f['channels'])}",
    Kind.SPEEDS_ZERO: lambda f, _: (
        f"{f['source']} {'report' if f['several'] else 'reports'} no rotor speeds: they are all zero"
    ),
    Kind.THRUST_FROM: "without rotor speeds, thrust is taken from the {source}",
    Kind.NO_MOTOR_SIGNAL: (
        "holds neither esc_status nor actuator_motors: thrust is known from the throttle command only"
    ),
    Kind.NOT_PULSES: "actuator_outputs are no pulse lengths in microseconds: not read as motor outputs",
    Kind.OUTPUT_CHAIN: _output_chain,
    Kind.BATTERY_SCALE: _battery_scale,
    Kind.ANGLE_BOOST: "throttle_cmd holds ArduPilot's angle boost (ATC_ANGLE_BOOST = {value:g}), as it is flown",
    Kind.PARAMETER_CHANGED: lambda f, times: (
        f"{f['name']} changed from {f['before']:g} to {f['after']:g} at {instants(times)}"
    ),
    Kind.ABSENT_MOTORS: lambda f, _: (
        f"left out as 0 or empty throughout, of motors that a vehicle with {f['rotors']} rotors does not have: "
        f"{', '.join(f['columns'])}"
    ),
    Kind.OWN_CORRECTION: _own_correction,
    Kind.STATE_INVALID: _invalid,
    Kind.RESET: _reset,
    Kind.ATTITUDE_READ: _attitude_read,
    Kind.NO_HEADING: _no_heading,
    Kind.HEADING_OFF: (
        "the heading does not fit the motion: it shows {by_deg:+.1f} +- {std_deg:.1f} degrees more than that (compass, "
        "or the axes of a motion capture), and is turned back"
    ),
    Kind.HEADING_DRIFTS: (
        "the heading drifts against the motion by {by_deg_s:+.3f} +- {std_deg_s:.3f} degrees per second, and is turned "
        "back"
    ),
    Kind.LANE_SWITCH: lambda f, times: (
        f"the autopilot changed to another core of its estimator at {instants(times)}: the state is read from the one "
        "that flew"
    ),
    Kind.REJECTED: lambda f, times: (
        f"the estimator rejected its measurement of {f['of']} {stretches(times)}: left out there"
    ),
    Kind.GPS_LOST: lambda f, times: f"the GPS had no fix {stretches(times)}: left out there",
    Kind.ON_GROUND: lambda f, times: (
        f"the vehicle stands on the ground {stretches(times)}, rotors working: left out there"
    ),
    Kind.GROUND_MOVED: (
        "the ground is at {before_m:.2f} m before a flight and at {after_m:.2f} m after it: a drift or reset of the "
        "height, or another ground"
    ),
    Kind.ENDS_IN_AIR: lambda f, times: (
        f"the log ends in the air, at {instants(times)}: it was cut short, or the power failed, and the flight went on"
    ),
    Kind.OUT_OF_CONTROL: _out_of_control,
    Kind.DEAD_CHANNEL: _dead_channel,
    Kind.FROZEN_ROTOR: _frozen_rotor,
    Kind.SPIKE: _spike,
    Kind.SPIKES: ("{updates} {of} that jump away and back, faster than a multirotor can move, are left out"),
    Kind.IN_FLIGHT: ("{seconds:.0f} s of {of_seconds:.0f} s are flight; the ground, take-off and landing are left out"),
    Kind.GAPS: "{seconds:.1f} s without new values (gaps over {longest_s:.1f} s) are left out",
    Kind.CLOCK_JUMP: lambda f, times: (
        f"the clock jumps by {', '.join(f'{by:.2g} s' for by in f['by_s'])} at {instants(times)}, as the positions on "
        "both sides show"
    ),
    Kind.INTERPOLATED: lambda f, _: (
        f"{f['channel']}: rows at {f['rows_hz']:.0f} Hz are drawn between packets of at most {f['at_most_hz']:.0f} Hz; "
        "the packets count"
    ),
    Kind.EXTRAPOLATED: lambda f, times: (
        f"{f['channel']} follows a straight line {stretches(times)}: drawn by a program, not measured; left out there"
    ),
    Kind.DELAY: _delay,
    Kind.BELOW_REST: (
        "the vehicle flies at {lowest_m:.2f} m, below the {rest_m:.2f} m at which it stands: heights near the ground "
        "are wrong (a barometer in the wash of the rotors, for example), and tell no ground effect"
    ),
    Kind.LEVER_ARM: _lever_arm,
    Kind.LEVEL_STEP: lambda f, times: (
        f"the attitude's level changes at {instants(times)} by {f['roll_deg']:.1f} degrees in roll and "
        f"{f['pitch_deg']:.1f} in pitch, and the vehicle does not speed up to that side: the board or a marker "
        f"slipped; what is {f['left_out']} is left out"
    ),
    Kind.WITNESSES_DISAGREE: _disagree,
    Kind.HEIGHT_ERROR: _height_error,
    Kind.ANOTHER_FACTOR: _another_factor,
    Kind.SWAPPED: _swapped,
    Kind.LEANS: (
        "the vehicle leans by {lean_deg:.0f} deg half of the time, expected less than {most_deg:.0f}: is the attitude "
        "in another frame, or its quaternion in another order?"
    ),
    Kind.NOT_GRAVITY: _not_gravity,
    Kind.GRAVITY_TURNED: _gravity_turned,
    Kind.STANDS_STILL: (
        "{channel} is {value:g} throughout while {while_changes} changes, expected nan where it is not known"
    ),
    Kind.ROTOR_UNKNOWN: _rotor_unknown,
    Kind.LACKS: _lacks,
    Kind.TOO_SLOW: _too_slow,
    Kind.BELOW_GROUND: "z_m falls at the take-off and stays below the ground in flight: are z_m and vz_m_s up?",
    Kind.TOO_SHORT: ("about {seconds:.0f} s of usable flight, an analysis needs at least {least_s:.0f} s"),
    Kind.WEIGHT_DOUBT: (
        "by the {source} the rotors of '{vehicle}' give {factor:.2g} times the thrust that carries its {mass_kg:g} kg: "
        "is it the vehicle that flew, with this mass and these propellers{line}?"
    ),
    Kind.FORCE_BY_ACCELEROMETER: (
        "the force on the body is that of the accelerometer, so that errors of motion capture's attitude do not turn "
        "it; the velocity checks it"
    ),
    Kind.VELOCITY_SCALE: (
        "{position} changes {factor:.2f} times as fast as {velocity} says: a clock, a unit or an estimator is off, and "
        "the acceleration may be wrong by as much"
    ),
}
