"""Findings about the record of a flight: facts with their figures and times, for the code that acts on them.

A finding is a value. Its sentence is made once, at the edge, by `quadctl.logs.words`.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Any, TypeAlias

Span: TypeAlias = tuple[float, float]
"""Begin and end of a stretch of time, s on the log's clock; the same twice for an instant."""


class Kind(StrEnum):
    """Kinds of findings, as they stand in JSON. `quadctl.logs.words` has the sentence of each."""

    # --- the file ---
    CUT_SHORT = "cut_short"
    LAST_LINE_CUT = "last_line_cut"
    DAMAGED = "damaged"
    DAMAGED_BYTES = "damaged_bytes"
    DAMAGED_LINES = "damaged_lines"
    LOST_BY_LOGGER = "lost_by_logger"
    SIDECAR_UNREADABLE = "sidecar_unreadable"
    NO_PARAMETERS = "no_parameters"
    COPY = "copy"
    # --- what was read, and how ---
    READ_BY_MAP = "read_by_map"
    SEVENTEEN_COLUMNS = "seventeen_columns"
    UNKNOWN_COLUMN = "unknown_column"
    ABSENT_COLUMNS = "absent_columns"
    TOPIC_LEFT_OUT = "topic_left_out"
    OTHER_SYSTEMS = "other_systems"
    REBOOTED = "rebooted"
    LEADING_ROWS = "leading_rows"
    TIME_STANDS_STILL = "time_stands_still"
    MESSAGES_OUT_OF_TIME = "messages_out_of_time"
    INFINITE_VALUES = "infinite_values"
    IMPOSSIBLE_VALUES = "impossible_values"
    # --- channels ---
    NO_VALUES = "no_values"
    NEVER_CHANGES = "never_changes"
    SPEEDS_ZERO = "speeds_zero"
    THRUST_FROM = "thrust_from"
    NO_MOTOR_SIGNAL = "no_motor_signal"
    NOT_PULSES = "not_pulses"
    OUTPUT_CHAIN = "output_chain"
    BATTERY_SCALE = "battery_scale"
    ANGLE_BOOST = "angle_boost"
    PARAMETER_CHANGED = "parameter_changed"
    ABSENT_MOTORS = "absent_motors"
    OWN_CORRECTION = "own_correction"
    # --- the estimator ---
    STATE_INVALID = "state_invalid"
    RESET = "reset"
    HEADING_OFF = "heading_off"
    HEADING_DRIFTS = "heading_drifts"
    NO_HEADING = "no_heading"
    ATTITUDE_READ = "attitude_read"
    LANE_SWITCH = "lane_switch"
    REJECTED = "rejected"
    GPS_LOST = "gps_lost"
    # --- time in flight ---
    ON_GROUND = "on_ground"
    GROUND_MOVED = "ground_moved"
    BELOW_REST = "below_rest"
    ENDS_IN_AIR = "ends_in_air"
    OUT_OF_CONTROL = "out_of_control"
    DEAD_CHANNEL = "dead_channel"
    FROZEN_ROTOR = "frozen_rotor"
    SPIKE = "spike"
    SPIKES = "spikes"
    IN_FLIGHT = "in_flight"
    GAPS = "gaps"
    CLOCK_JUMP = "clock_jump"
    INTERPOLATED = "interpolated"
    EXTRAPOLATED = "extrapolated"
    DELAY = "delay"
    LEVER_ARM = "lever_arm"
    LEVEL_STEP = "level_step"
    WITNESSES_DISAGREE = "witnesses_disagree"
    HEIGHT_ERROR = "height_error"
    # --- channels against each other ---
    ANOTHER_FACTOR = "another_factor"
    SWAPPED = "swapped"
    LEANS = "leans"
    NOT_GRAVITY = "not_gravity"
    GRAVITY_TURNED = "gravity_turned"
    STANDS_STILL = "stands_still"
    ROTOR_UNKNOWN = "rotor_unknown"
    # --- what an analysis lacks ---
    LACKS = "lacks"
    TOO_SLOW = "too_slow"
    BELOW_GROUND = "below_ground"
    TOO_SHORT = "too_short"
    # --- the vehicle ---
    WEIGHT_DOUBT = "weight_doubt"
    VELOCITY_SCALE = "velocity_scale"
    FORCE_BY_ACCELEROMETER = "force_by_accelerometer"


@dataclass(frozen=True)
class Finding:
    """Fact about a record."""

    kind: Kind
    figures: Mapping[str, Any] = field(default_factory=dict)
    """By name; units in the names."""
    times_s: tuple[Span, ...] = ()
    """Times that it concerns; empty for the whole log."""

    def to_dict(self) -> dict[str, Any]:
        """Form in JSON."""
        return {
            "kind": str(self.kind),
            **({"times_s": [list(span) for span in self.times_s]} if self.times_s else {}),
        } | {"figures": dict(self.figures)}

    def later(self, by_s: float) -> "Finding":
        """The same on a clock that shows more by `by_s`."""
        return replace(self, times_s=tuple((begin + by_s, end + by_s) for begin, end in self.times_s))

    def touches(self, begin_s: float, end_s: float) -> bool:
        """Tell whether it concerns a stretch of time."""
        return not self.times_s or any(begin <= end_s and end >= begin_s for begin, end in self.times_s)


def finding(kind: Kind, times_s: Iterable[Span] = (), **figures: Any) -> Finding:
    """Make a finding of its figures."""
    return Finding(kind, figures, tuple(times_s))


def of_kind(findings: Iterable[Finding], *kinds: Kind) -> list[Finding]:
    """Findings of some kinds, in their order."""
    return [found for found in findings if found.kind in kinds]
