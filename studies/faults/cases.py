"""The faults, each with its expected result."""

import math
import resource
import socket
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from signal import SIGCONT, SIGINT, SIGKILL, SIGSTOP, SIGTERM, SIGUSR1, SIGUSR2
from typing import Any

from quadctl.effects.rotor_fault import WeakRotor
from quadctl.sitl.rules.copter import LANE_STEP_M, SimulatedCopter
from quadctl.sitl.server import faults
from studies.autopilots.weak_motor import loss_of_pulse

from .scene import HERE, Profile, Scene, Seen, Setting

SILENCE_S = 0.3
"""Longest time after the fault at which a stalled or blind flight may still send a setpoint."""
LAND_SEEN_S = 0.5
"""Longest time until a change of mode shows in a heartbeat."""


@dataclass(frozen=True)
class Case:
    """A fault in hover, with its expected result."""

    name: str
    inject: Callable[[Scene], None]
    answer: str
    """Answer of the guards, as in the log; empty where the process can no longer answer. After a stall `hand over or
    release`, depending on which of the waiting messages is read first."""
    said: str
    """Text in the log about the end of the flight."""
    mode: str = "land"
    """Expected next mode: land, boot, failsafe, stick or return; empty for none."""
    silent_s: float = SILENCE_S
    """Latest time of the last setpoint, s; for a landing, of the change of mode."""
    answered_s: float = math.inf
    """Latest time of the change of mode, s."""
    setting: Setting = field(default_factory=Setting)
    """Settings of this flight."""
    on_ardupilot: Mapping[str, Any] = field(default_factory=dict)
    """Fields of this class that differ on ArduPilot."""

    def on(self, autopilot: str) -> "Case":
        """Expected result on `autopilot`."""
        return replace(self, **self.on_ardupilot) if autopilot == "ardupilot" else self

    def wrong(self, seen: Seen, profile: Profile) -> list[str]:
        """Differences from the expected result."""
        modes = {
            "land": "LAND",
            "boot": profile.boot,
            "failsafe": profile.failsafe,
            "stick": profile.stick,
            "return": "RTL",
        }
        expected = modes.get(self.mode, "")
        silent_s = self.silent_s
        if self.answer == "land" and seen.modes:
            silent_s = seen.modes[0][1] + LAND_SEEN_S
        checks = {
            f"the next mode is {seen.mode or 'none'}, expected {expected or 'none'}": seen.mode == expected,
            f"{len(seen.unfit)} setpoints were unfit: {seen.unfit[:1]}": not seen.unfit,
            f"the last setpoint came {seen.last_setpoint_s:.2f} s after, allowed are {silent_s:.2f} s": (
                seen.last_setpoint_s <= silent_s
            ),
            f"the log says {seen.ended!r}, expected {self.said!r}": self.said in seen.ended,
            f"the log's answers are {seen.events}, expected {self.answer}": (
                not self.answer or bool({answer for _, answer in seen.events} & set(self.answer.split(" or ")))
            ),
            f"{seen.rows_lost_s:.1f} s of log are lost": seen.rows_lost_s <= 1.0 or "incomplete" in seen.problem,
            "it did not come to rest": not math.isnan(seen.at_rest_s),
        }
        if seen.modes:
            answered_s = seen.modes[0][1]
            late = f"the autopilot changed its mode after {answered_s:.2f} s, allowed are {self.answered_s:.2f} s"
            checks[late] = answered_s <= self.answered_s
        if self.answer == "land" and seen.modes:
            checks[f"the landing began after {seen.modes[0][1]:.2f} s"] = seen.modes[0][1] <= self.silent_s
        return [sentence for sentence, holds in checks.items() if not holds]


def _distort(make: Callable[[], faults.Distortion]) -> Callable[[Scene], None]:
    def inject(scene: Scene) -> None:
        scene.px.faults.distort = make()

    return inject


def _withhold(*names: str) -> Callable[[Scene], None]:
    def inject(scene: Scene) -> None:
        scene.px.faults.withheld = frozenset(names)

    return inject


def _stop(scene: Scene) -> None:
    scene.signal(SIGSTOP)
    scene.later(3.0, lambda: scene.signal(SIGCONT))


def _stop_and_take(scene: Scene) -> None:
    """Late enough that what was queued before still says offboard."""
    _stop(scene)
    scene.later(0.3, lambda: scene.stick(scene.profile.stick))
    scene.later(4.5, lambda: scene.stick("LAND"))


def _take(scene: Scene) -> None:
    scene.stick(scene.profile.stick)
    scene.later(1.5, lambda: scene.stick("LAND"))


def _take_and_return(scene: Scene) -> None:
    """The switch goes to the pilot's mode and back, as a finger slips: offboard is not flown on."""
    scene.stick(scene.profile.stick)
    scene.later(0.5, lambda: scene.px.autopilot._enter(scene.profile.offboard))


def _take_for(seconds: float) -> Callable[[Scene], None]:
    """The switch goes to the pilot's mode and back so soon that a heartbeat in a second need not show it.

    It goes just after a heartbeat, where that is all that tells the mode.
    """

    def inject(scene: Scene) -> None:
        scene.after_heartbeat()
        scene.stick(scene.profile.stick)
        scene.later(seconds, lambda: scene.px.autopilot._enter(scene.profile.offboard))
        scene.later(2.0, lambda: scene.stick("LAND"))

    return inject


def _be(**changes: object) -> Callable[[Scene], None]:
    def inject(scene: Scene) -> None:
        for name, value in changes.items():
            setattr(scene.px.faults, name, value)

    return inject


def _disarm(scene: Scene) -> None:
    """Just after a heartbeat: on PX4 the next one comes a second later."""
    scene.after_heartbeat()
    scene.px.autopilot.force_disarm()


def _restart(scene: Scene) -> None:
    """Half a second deaf and without a word, then as after power-up."""
    scene.px.faults.silent = scene.px.faults.deaf = True
    scene.px.restart()
    scene.later(0.5, lambda: _be(silent=False, deaf=False)(scene))


def _restart_at_once(scene: Scene) -> None:
    scene.px.restart()


def _refuse_landing(scene: Scene) -> None:
    """Refuse modes for 1.5 s: until PX4 has acted by itself, and before ArduPilot, which does not, is asked again."""
    scene.px.faults.refuse_modes = "not now"
    scene.signal(SIGINT)
    scene.later(1.5, lambda: _be(refuse_modes="")(scene))


def _interrupt_twice(scene: Scene) -> None:
    scene.signal(SIGINT)
    scene.later(0.05, lambda: scene.signal(SIGINT))


def _interrupt_twice_unheard(scene: Scene) -> None:
    """The autopilot hears neither the targets nor the wish to land."""
    scene.px.faults.deaf = True
    _interrupt_twice(scene)


def _land_without_end(scene: Scene) -> None:
    """The land mode is taken, and the vehicle stays up until somebody brings it down."""
    name = scene.profile.land_speed
    scene.px.autopilot.parameters[name], speed = 0.0, scene.px.autopilot.parameters[name]
    scene.signal(SIGINT)
    scene.later(OVER_TIME_S + 1.0, lambda: scene.px.autopilot.parameters.update({name: speed}))


def _lose_remote(scene: Scene) -> None:
    """The return climbs to a metre only, so that it ends in time."""
    if "RTL_ALT" in scene.px.autopilot.parameters:
        scene.px.autopilot.parameters["RTL_ALT"] = 100.0
    scene.px.autopilot.lose_remote()


def _step_height(scene: Scene) -> None:
    """The estimator switches to another lane; PX4, which was not seen to, steps as far."""
    if isinstance(scene.px.autopilot, SimulatedCopter):
        scene.px.autopilot.switch_lane()
    else:
        scene.px.faults.distort = faults.displaced((0.0, 0.0, -LANE_STEP_M))


def _rise_out_of_the_data(scene: Scene) -> None:
    """The estimate says so, and the vehicle goes down for it."""
    scene.px.faults.distort = faults.displaced((0.0, 0.0, -0.45), 0.9)
    scene.later(2.0, lambda: scene.signal(SIGINT))


def _open_the_port_too(scene: Scene) -> None:
    """Open a socket as a ground station does; where it gets the port, it takes the datagrams."""
    host, port = scene.px.address
    second = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    for option in (socket.SO_REUSEADDR, socket.SO_REUSEPORT):
        second.setsockopt(socket.SOL_SOCKET, option, 1)
    with suppress(OSError):
        second.bind((host, port))
    scene.later(2.0, lambda: scene.signal(SIGINT))
    scene.later(2.1, second.close)


def _weaken(loss: float) -> Callable[[Scene], None]:
    """The first motor loses a share of its thrust, for good; a vehicle that bears it is landed by Ctrl-C after 5 s."""

    def inject(scene: Scene) -> None:
        body = scene.px.autopilot.body
        body.truth = body.truth.plus(WeakRotor(loss=loss, rotor=1.0))
        scene.later(5.0, lambda: _interrupt(scene))

    return inject


def _interrupt(scene: Scene) -> None:
    if scene.process.poll() is None:
        scene.signal(SIGINT)


def _fill_disk(scene: Scene) -> None:
    """Limit the size of files to the present size of the log."""
    size = scene.log.stat().st_size
    resource.prlimit(scene.process.pid, resource.RLIMIT_FSIZE, (size, size))
    scene.later(1.0, lambda: scene.signal(SIGTERM))


def _delay_ours(scene: Scene) -> None:
    scene.line.up.delay_s = 0.3
    scene.line.apply()


def _shake(scene: Scene) -> None:
    """Troubles that a flight bears, and a landing too."""
    for way in (scene.line.down, scene.line.up):
        way.jitter_s, way.loss, way.duplicates = 0.04, 0.1, 0.1
    scene.line.apply()
    scene.later(3.0, lambda: scene.signal(SIGINT))


OVER_TIME_S = 2.0
LET_GO = "hand over or release"
ON_A_LINE = Setting(on_a_line=True)
SIX = Setting(vehicle="f550")
SLOW = "the link is slow"
NAN, STALE, STALL = "not a number", "s old, allowed are 0.2 s", "the control loop stalled for"

PROCESS = (
    Case("event loop frozen for 3 s", lambda s: s.signal(SIGUSR1), LET_GO, STALL, "failsafe"),
    Case(
        "event loop frozen for 0.6 s",
        lambda s: s.signal(SIGUSR1),
        "hand over",
        STALL,
        setting=Setting(stall_s=0.6),
        on_ardupilot={"mode": "failsafe"},
    ),
    Case("interpreter held for 3 s", lambda s: s.signal(SIGUSR2), LET_GO, STALL, "failsafe"),
    Case(
        "event loop frozen for ever",
        lambda s: s.signal(SIGUSR1),
        "",
        "in flight",
        "failsafe",
        setting=Setting(stall_s=60.0),
    ),
    Case("process stopped for 3 s", _stop, LET_GO, STALL, "failsafe"),
    Case("process stopped, the pilot takes the mode", _stop_and_take, LET_GO, STALL, "stick"),
    Case("process killed", lambda s: s.signal(SIGKILL), "", "in flight", "failsafe"),
    Case("disk full", _fill_disk, "land", "asked to land by SIGTERM", silent_s=2.0),
)
STATE = (
    Case("position not a number", _distort(lambda: faults.nan_position), "hand over", NAN),
    Case("attitude of zeros", _distort(lambda: faults.no_attitude), "hand over", "no unit quaternion"),
    Case("position stops coming", _withhold("LOCAL_POSITION_NED"), "hand over", STALE),
    Case("attitude stops coming", _withhold("ATTITUDE_QUATERNION"), "hand over", STALE),
    Case(
        "position frozen", _distort(lambda: faults.frozen("position")), "hand over", "position is frozen", silent_s=0.8
    ),
    Case(
        "attitude frozen", _distort(lambda: faults.frozen("attitude")), "hand over", "attitude is frozen", silent_s=0.8
    ),
    Case("position jumps by 2 m", _distort(lambda: faults.displaced((2.0, 0.0, 0.0))), "hand over", "position jumped"),
    Case("estimator switches its lane", _step_height, "hand over", "position jumped by 0.7"),
    Case("attitude jumps by 45 deg", _distort(lambda: faults.leaning(math.radians(45.0))), "hand over", "jumped"),
    Case(
        "position aid lost",
        lambda s: s.px.autopilot.lose_position_aid(),
        "hand over",
        "states a standard deviation of 0.5",
        silent_s=2.3,
        on_ardupilot={"said": "has lost its source of position", "silent_s": 1.0},
    ),
    Case("estimator rejects its sensors", _be(estimator_ratio=2.0), "hand over", "estimator is in doubt", silent_s=0.6),
)
LIMITS = (
    Case("tilt", _distort(lambda: faults.leaning(math.radians(60.0))), "hand over", "the tilt is"),
    Case("speed", _distort(lambda: faults.hurried(12.0, 0.5)), "land", "the speed is", silent_s=1.5),
    Case("fence", _distort(lambda: faults.displaced((0.0, 6.0, 0.0), 1.0)), "land", "from take-off", silent_s=2.0),
    Case("ceiling", _distort(lambda: faults.displaced((0.0, 0.0, -6.0), 1.0)), "land", "allowed are 1.5", silent_s=2.0),
    Case("floor", _distort(lambda: faults.displaced((0.0, 0.0, 6.0), 1.0)), "land", "m or more", silent_s=2.0),
    Case(
        "landing does not end",
        _land_without_end,
        "end",
        f"did not land and disarm in {OVER_TIME_S:g} s",
        silent_s=0.5,
        setting=Setting(guards={"max_over_time_s": OVER_TIME_S}),
    ),
    Case(
        "compensator beyond its data",
        _rise_out_of_the_data,
        "fade out",
        "asked to land by SIGINT",
        silent_s=2.5,
        setting=Setting(model=HERE / "fitted.yaml"),
    ),
    Case(
        "stands on the ground, the estimate says it flies",
        _distort(lambda: faults.displaced((0.0, 0.0, -0.9), 1.5)),
        "hand over",
        "the vehicle touches the ground",
        silent_s=8.0,
    ),
    Case(
        "pushed off its place",
        _distort(lambda: faults.displaced((0.0, 1.2, 0.0), 0.4)),
        "hand over",
        "the horizontal error has been over 0.6 m",
        silent_s=3.0,
        setting=Setting(guards={"following": {"max_horizontal_error_m": 0.6, "max_error_s": 0.3}}),
    ),
    Case(
        "battery failure",
        lambda s: s.px.autopilot.fail_battery(),
        "release",
        "left offboard for HOLD",
        "boot",  # HOLD, for five seconds
        silent_s=0.5,
        on_ardupilot={"said": "left offboard for LAND", "mode": "land"},
    ),
    Case("remote control lost", _lose_remote, "release", "left offboard for RTL", "return", silent_s=0.5),
    Case("battery low", _distort(lambda: faults.battery_at(12.0)), "land", "the battery is at 12.00 V", silent_s=1.0),
)
ROTORS = (
    Case(
        "a motor of four at half thrust",
        _weaken(0.5),
        "land",
        "asked to land by SIGINT",
        silent_s=5.5,
        on_ardupilot={"said": "from take-off", "silent_s": 2.5},
    ),
    Case(
        "a motor of four at half its pulse",
        _weaken(loss_of_pulse(0.5)),
        "hand over",
        "the vehicle stays on the ground",
        silent_s=2.5,
    ),
    Case("a motor of six at half thrust", _weaken(0.5), "land", "asked to land by SIGINT", silent_s=5.5, setting=SIX),
    Case("a motor of six at a tenth of its thrust", _weaken(0.9), "land", "from take-off", silent_s=2.5, setting=SIX),
    Case("process killed, six rotors", lambda s: s.signal(SIGKILL), "", "in flight", "failsafe", setting=SIX),
    Case(
        "Ctrl-C, six rotors", lambda s: s.signal(SIGINT), "land", "asked to land by SIGINT", silent_s=0.5, setting=SIX
    ),
)
LINK = (
    Case("autopilot's messages stop", _be(silent=True), "hand over", STALE, answered_s=0.5),
    Case("delay of 0.25 s each way", lambda s: s.line.delay(0.25), "hand over", STALE, silent_s=0.6, setting=ON_A_LINE),
    Case(
        "delay grows by 20 ms/s each way",
        lambda s: s.line.delay_more_and_more(0.02, 0.4),
        "hand over",
        SLOW,
        silent_s=7.0,
        setting=ON_A_LINE,
    ),
    Case(
        "setpoints are delayed by 0.3 s",
        _delay_ours,
        "hand over",
        SLOW,
        silent_s=1.5,
        setting=ON_A_LINE,
    ),
    Case(
        "jitter, loss, reordering, duplicates, then Ctrl-C",
        _shake,
        "land",
        "asked to land by SIGINT",
        silent_s=5.0,
        setting=ON_A_LINE,
    ),
    Case(
        "heartbeats stop",
        _withhold("HEARTBEAT"),
        "hand over",
        "heartbeat is lost",
        silent_s=6.5,  # CURRENT_MODE still tells its mode
        on_ardupilot={"mode": "failsafe", "silent_s": 3.5},  # nothing else tells its mode
    ),
    Case("autopilot hears nothing", _be(deaf=True), "release", "left offboard", "failsafe", silent_s=1.5),
    Case(
        "disarmed in flight",
        _disarm,
        "release",
        "the vehicle was disarmed",
        "",
    ),
    Case("autopilot restarts within 0.5 s", _restart, "hand over", STALE, "boot"),
    Case(
        "a second program opens the UDP port",
        _open_the_port_too,
        "land",
        "asked to land by SIGINT",
        silent_s=2.5,
    ),
    Case(
        "autopilot restarts at once",
        _restart_at_once,
        "release",
        "",
        "boot",
        silent_s=0.5,
        on_ardupilot={"answer": LET_GO},
    ),
)
PEOPLE = (
    Case("the pilot takes the mode", _take, "release", "left offboard", "stick", silent_s=0.5),
    Case(
        "the mode is taken and given back",
        _take_and_return,
        "release",
        "left offboard",
        "stick",
        silent_s=0.5,
        on_ardupilot={"said": "GUIDED again, which nobody flies: its failsafe lands it when quadctl is gone"},
    ),
    Case("the mode is taken for 0.3 s", _take_for(0.3), "release", "left offboard", "stick", silent_s=0.5),
    Case("Ctrl-C", lambda s: s.signal(SIGINT), "land", "asked to land by SIGINT", silent_s=0.5),
    Case("Ctrl-C, landing refused", _refuse_landing, "silence", "refused to enter LAND", "failsafe", silent_s=1.0),
    Case("Ctrl-C twice", _interrupt_twice, "hand over", "asked to let go", silent_s=0.5),
    Case("Ctrl-C twice, autopilot hears nothing", _interrupt_twice_unheard, "hand over", "let go", "failsafe"),
)
CASES = (*PROCESS, *STATE, *LIMITS, *ROTORS, *LINK, *PEOPLE)
