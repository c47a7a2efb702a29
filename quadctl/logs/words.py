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
    steps = ", ".join(f"{ratio:.3f} at {height:.2f} m" for height, ratio in figures["ratio_at_height_m"])
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


def _frozen_state(figures: _Figures, times_s: Sequence[Span]) -> str:
    return (
        f"position or attitude are frozen for {figures['seconds']:.0f} s in flight, the first time at "
        f"{times_s[0][0]:.0f} s"
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
    Kind.ABSENT_MOTORS: lambda f, _: (
        f"left out as 0 or empty throughout, of motors that a vehicle with {f['rotors']} rotors does not have: "
        f"{', '.join(f['columns'])}"
    ),
    Kind.OWN_CORRECTION: _own_correction,
    Kind.STATE_INVALID: _invalid,
    Kind.RESET: lambda f, times: f"the estimator reset its {f['of']} at {instants(times)}: it jumps there",
    Kind.FROZEN_STATE: _frozen_state,
    Kind.FROZEN_ROTOR: _frozen_rotor,
    Kind.SPIKES: ("{updates} {of} that jump away and back, faster than a multirotor can move, are left out"),
    Kind.IN_FLIGHT: ("{seconds:.0f} s of {of_seconds:.0f} s are flight; the ground, take-off and landing are left out"),
    Kind.GAPS: "{seconds:.1f} s without new values (gaps over {longest_s:.1f} s) are left out",
    Kind.WEIGHT_DOUBT: (
        "by the {source} the rotors of '{vehicle}' give {factor:.2g} times the thrust that carries its {mass_kg:g} kg: "
        "is it the vehicle that flew, with this mass and these propellers{line}?"
    ),
    Kind.VELOCITY_SCALE: (
        "{position} changes {factor:.2f} times as fast as {velocity} says: a clock, a unit or an estimator is off, and "
        "the acceleration may be wrong by as much"
    ),
}
