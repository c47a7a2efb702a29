"""Probes: measurements of a mock in simulated time, each of the quantity that was measured on the real autopilot."""

import copy
import math
from collections.abc import Callable
from functools import cache

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from quadctl.control.attitude import attitude_for_force
from quadctl.effects.rotor_fault import WeakRotor
from quadctl.frames import rotate
from quadctl.sitl.rules.copter import CLIMBED_M, Guided, SimulatedCopter, SimulatedCopter47
from quadctl.sitl.rules.px4 import SimulatedAutopilot
from quadctl.sitl.server.ardupilot import MavlinkArduPilot
from quadctl.state import AttitudeTarget
from quadctl.thrust_chain.ardupilot import thrust_of_output
from quadctl.thrust_chain.chain import Ambient

from .measured import mock, on_the_wire
from .weak_motor import loss_of_pulse

TICK_S = 0.02
PATIENCE_S = 60.0
LEVEL = (1.0, 0.0, 0.0, 0.0)
HOVER_M = 1.5
GROUND_M = 0.1
TILT_RAD = math.radians(14.0)


def until(px: SimulatedAutopilot, condition: Callable[[], bool], each: Callable[[], None] = lambda: None) -> float:
    """Time that passes until `condition`; `each` is called before each tick. Infinite after PATIENCE_S."""
    begin_s = px.time_s
    while not condition():
        if px.time_s - begin_s > PATIENCE_S:
            return math.inf
        each()
        px.step(px.time_s + TICK_S)
    return px.time_s - begin_s


def hovering(
    name: str, vehicle: str = "vehicle.yaml", rules: type[SimulatedAutopilot] | None = None
) -> SimulatedAutopilot:
    """Mock in a hover at HOVER_M in the mode of targets, held there by targets: a copy of one that has flown there."""
    return copy.deepcopy(_hovering(name, vehicle, rules))  # type: ignore[arg-type]  # a class is hashable


@cache
def _hovering(name: str, vehicle: str, rules: type[SimulatedAutopilot] | None) -> SimulatedAutopilot:
    px = mock(name, vehicle=vehicle, rules=rules)
    until(px, lambda: px.estimate().ready_to_arm)
    px.set_attitude_target(AttitudeTarget(LEVEL, 0.0))
    px.request_mode(px.offboard_mode)
    px.request_arm()
    if isinstance(px, SimulatedCopter):
        px.request_take_off(HOVER_M)
        until(px, lambda: -px.body.position[2] > HOVER_M - 0.05)
    until(px, lambda: px.time_s > 25.0, lambda: hold(px))
    return px


def hold(px: SimulatedAutopilot) -> None:
    """Send the target that holds HOVER_M, computed from the true state."""
    (x, y, z), (vx, vy, vz) = px.body.position, px.body.velocity
    m = px.vehicle.mass_kg
    north, east = -1.0 * x - 1.6 * vx, -1.0 * y - 1.6 * vy
    down = -9.80665 + 2.0 * (-HOVER_M - z) - 3.0 * vz
    attitude = attitude_for_force((m * north, m * east, m * down), 0.0)
    px.set_attitude_target(AttitudeTarget(attitude, _throttle(px, -m * down)))


def _throttle(px: SimulatedAutopilot, thrust_n: float) -> float:
    return min(max(px.vehicle.throttle.offset + px.vehicle.throttle.per_newton * thrust_n, 0.0), 1.0)


# --- probes -----------------------------------------------------------------------------------------------------------


def heartbeat_hz(name: str) -> float:
    return on_the_wire(mock(name), name)._streams[mavlink.MAVLINK_MSG_ID_HEARTBEAT].default_rate_hz


def heartbeat_interval(name: str) -> str:
    return "refused" if on_the_wire(mock(name), name).manners.fixed_heartbeats else "accepted"


def position_hz(name: str) -> float:
    return on_the_wire(mock(name), name).manners.streams[mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED].default_rate_hz


def attitude_hz(name: str) -> float:
    return on_the_wire(mock(name), name).manners.streams[mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION].default_rate_hz


def timesync(name: str) -> str:
    """Answer to a question about its clock."""
    wire = on_the_wire(mock(name), name)
    sent: list[object] = []
    wire._send = sent.append  # type: ignore[method-assign, assignment]  # it has no socket here
    wire._timesync(mavlink.MAVLink_timesync_message(0, 1))
    return "answered" if sent else "ignored"


def timesync_hz(name: str) -> float:
    return on_the_wire(mock(name), name).manners.streams[mavlink.MAVLINK_MSG_ID_TIMESYNC].default_rate_hz


def ready_s(name: str) -> float:
    px = mock(name)
    return until(px, lambda: px.estimate().ready_to_arm)


def setpoints_lost_s(name: str) -> float:
    px = hovering(name)
    if isinstance(px, SimulatedCopter):
        return until(px, lambda: px.guided is Guided.LEVEL)
    return until(px, lambda: px.mode != px.offboard_mode)


def setpoints_lost_mode(name: str) -> str:
    """Mode after the last setpoint, by the default of COM_OBL_RC_ACT, without a remote control."""
    px = hovering(name)
    px.remote = False
    px.parameters["COM_OBL_RC_ACT"] = 0.0
    until(px, lambda: px.mode != px.offboard_mode)
    return px.mode


def station_lost_s(name: str) -> float:
    """Time to LAND after a heartbeat that came half a second before the end, as on average."""
    px = hovering(name)
    px.hear_heartbeat(1)
    heard_s = px.time_s
    until(px, lambda: px.time_s > heard_s + 0.5)
    return until(px, lambda: px.mode == "LAND")


def position_lost_s(name: str) -> float:
    px = hovering(name)
    px.lose_position_aid()
    return until(px, lambda: px.mode == "LAND", lambda: hold(px))


def remote_lost(name: str) -> str:
    px = hovering(name)
    height_m = -px.body.position[2]
    px.lose_remote()
    mode = px.mode
    px.step(px.time_s + 5.0)
    return f"{mode}, climbs" if -px.body.position[2] > height_m + 1.0 else mode


def return_near_home(name: str) -> str:
    """Height of a return of version 4.7 from over its home, by the default height of 15 m."""
    px = hovering(name, rules=SimulatedCopter47)
    before_m = -px.body.position[2]
    px.request_mode("RTL")
    highest_m = [before_m]
    until(px, lambda: px.landed, lambda: highest_m.append(-px.body.position[2]))
    return "does not climb" if max(highest_m) < before_m + CLIMBED_M else "climbs"


def failsafe_landing_s(name: str) -> float:
    """Time by which the LAND of a failsafe reaches the ground after one that is commanded."""
    lands: tuple[Callable[[SimulatedCopter], object], ...] = (
        SimulatedCopter.fail_battery,
        lambda px: px.request_mode("LAND"),
    )

    def landed_after_s(land: Callable[[SimulatedCopter], object]) -> float:
        px = hovering(name)
        assert isinstance(px, SimulatedCopter)
        land(px)
        return until(px, lambda: px.body.in_contact)

    failed_s, commanded_s = map(landed_after_s, lands)
    return failed_s - commanded_s


def stick_off_neutral(name: str) -> str:
    px = mock(name)
    assert isinstance(px, SimulatedCopter)
    px.stick_neutral = False
    until(px, lambda: px.estimate().ready_to_arm)
    px.request_mode(px.offboard_mode)
    return "refused" if px.request_arm() else "accepted"


def lane_switch_m(name: str) -> float:
    """Step of the height that its estimate tells."""
    px = hovering(name)
    assert isinstance(px, SimulatedCopter)
    before_m = px.estimate().position_ned_m[2]
    px.switch_lane()
    px.step(px.time_s + TICK_S)
    return before_m - px.estimate().position_ned_m[2]


def station_ignored(name: str) -> str:
    px = hovering(name)
    px.parameters["SYSID_MYGCS"] = 255.0
    px.hear_heartbeat(1)
    return "never" if math.isinf(until(px, lambda: px.mode == "LAND")) else "landed"


def climb_s(name: str) -> float:
    px = mock(name)
    until(px, lambda: px.estimate().ready_to_arm)
    px.request_mode(px.offboard_mode)
    px.request_arm()
    px.request_take_off(2.0)
    return until(px, lambda: -px.body.position[2] > 1.9)


def landed_s(name: str) -> float:
    px = hovering(name)
    px.request_mode("LAND")
    return until(px, lambda: px.body.in_contact)


def disarmed_s(name: str) -> float:
    px = hovering(name)
    px.request_mode("LAND")
    return until(px, lambda: not px.armed)


def idle_s(name: str) -> float:
    """Time armed on the ground without a throttle until it disarms."""
    px = mock(name)
    until(px, lambda: px.estimate().ready_to_arm)
    px.set_attitude_target(AttitudeTarget(LEVEL, 0.0))
    px.request_mode(px.offboard_mode)
    px.request_arm()
    return until(px, lambda: not px.armed, lambda: px.set_attitude_target(AttitudeTarget(LEVEL, 0.0)))


def hover_throttle(name: str) -> float:
    """Throttle of hover by the vehicle file, which the mock obeys at the reference voltage of its battery."""
    px = mock(name)
    return _throttle(px, px.vehicle.weight_n)


def added_at_14_deg(name: str) -> float:
    """Thrust that the mock flies over the thrust of a target at 14 degrees of tilt, less 1, in percent."""
    px = hovering(name)
    throttle = _throttle(px, px.vehicle.weight_n)
    w, x = math.cos(0.5 * TILT_RAD), math.sin(0.5 * TILT_RAD)
    px.set_attitude_target(AttitudeTarget((w, x, 0.0, 0.0), throttle))
    px.body.attitude = (w, x, 0.0, 0.0)
    return 100.0 * (px._active.throttle / throttle - 1.0)


def outputs_over_command(name: str) -> float:
    """Motor output over the command, the curve of the motors alone removed."""
    px = hovering(name)
    wire = on_the_wire(px, name)
    assert isinstance(wire, MavlinkArduPilot)
    throttle = _throttle(px, px.vehicle.weight_n)
    share = wire.pulse_us(throttle) / 1000.0 - 1.0
    chain = {key: value for key, value in px.parameters.items() if "VOLT" not in key}

    return float(thrust_of_output(share, chain, Ambient())) / throttle


def second_station(name: str) -> str:
    """Answer to another mode in flight; the mock's rules do not ask who wants it."""
    px = hovering(name)
    return "accepted at once" if all(px.request_mode(mode) is None for mode in ("LOITER", "LAND")) else "refused"


def half_pulse_s(name: str) -> float:
    """Time to the ground with one motor at half its pulse."""
    px = _with_weak_motor(name, 0.5)
    return until(px, lambda: -px.body.position[2] < GROUND_M, lambda: hold(px))


def six_at_a_tenth_s(name: str) -> float:
    """Time to the ground with one motor of six at a tenth of its pulse."""
    px = _with_weak_motor(name, 0.1, "hexa_vehicle.yaml")
    return until(px, lambda: -px.body.position[2] < GROUND_M, lambda: hold(px))


def lean_at_80_deg(name: str) -> float:
    """Largest lean with one motor at 80 % of its pulse, degrees."""
    px, leans = _with_weak_motor(name, 0.8), [0.0]

    def watch() -> None:
        hold(px)
        leans.append(math.degrees(math.acos(min(rotate(px.body.attitude, (0.0, 0.0, 1.0))[2], 1.0))))

    until(px, lambda: False, watch)
    return max(leans)


def _with_weak_motor(name: str, pulse: float, vehicle: str = "vehicle.yaml") -> SimulatedAutopilot:
    """Mock in a hover, from now on with its first motor at a share of its pulse."""
    px = hovering(name, vehicle)
    px.body.truth = px.body.truth.plus(WeakRotor(loss=loss_of_pulse(pulse), rotor=1.0))
    return px


PROBES: dict[str, Callable[[str], str | float]] = {
    probe.__name__: probe
    for probe in (
        *(timesync, timesync_hz),
        *(heartbeat_hz, heartbeat_interval, position_hz, attitude_hz, ready_s, setpoints_lost_s, setpoints_lost_mode),
        *(
            station_lost_s,
            station_ignored,
            position_lost_s,
            remote_lost,
            climb_s,
            landed_s,
            disarmed_s,
            idle_s,
            hover_throttle,
            added_at_14_deg,
        ),
        *(outputs_over_command, second_station, half_pulse_s, six_at_a_tenth_s, lean_at_80_deg),
        *(return_near_home, failsafe_landing_s, stick_off_neutral, lane_switch_m),
    )
}
