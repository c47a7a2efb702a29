"""Flights of the study: three controls, then ten traps, each a plausible flight of a plausible vehicle."""

from collections.abc import Callable, Iterable, Sequence
from typing import TypeAlias

import numpy as np

from quadctl.logs.flight_log import FlightLog
from studies.worlds.traps.judgement import Honest, Trap
from studies.worlds.traps.simulation import (
    OUTDOORS,
    STEP_S,
    WEIGHT_M_S2,
    Body,
    Floats,
    Leg,
    Sensors,
    World,
    fly,
    heading,
    rotation,
)

CONTROLS: list[Trap] = []
TRAPS: list[Trap] = []


Generate: TypeAlias = Callable[[str, str], FlightLog | Sequence[FlightLog]]
"""Flies one flight or more, by the name of the trap and that of the vehicle."""


def listed(group: list[Trap], vehicle: str, honest: Honest) -> Callable[[Generate], Generate]:
    """Decorator that adds a flight, or several, to a group; its docstring becomes the text of the page."""

    def add(generate: Generate) -> Generate:
        name = generate.__name__
        text = " ".join((generate.__doc__ or "").split())

        def flights() -> Sequence[FlightLog]:
            flown = generate(name, vehicle)
            return [flown] if isinstance(flown, FlightLog) else flown

        group.append(Trap(name, vehicle, honest, text, flights))
        return generate

    return add


def back_and_forth(
    half_m: float, up_m: float, move_s: float, hover_s: float, times: int, axis: str = "north"
) -> list[Leg]:
    """Runs between two places on the north or east axis, from the southern or western one on."""
    ends = [-half_m, half_m] * times + [-half_m]
    places = [(end, 0.0) if axis == "north" else (0.0, end) for end in ends]
    return [Leg(north, east, up_m, move_s, hover_s) for north, east in places]


def staircase(heights_m: Iterable[float], move_s: float, hover_s: float) -> list[Leg]:
    """Hover at one height after another."""
    return [Leg(0.0, 0.0, height, move_s, hover_s) for height in heights_m]


def all_round() -> list[Leg]:
    """Mission of the controls of 90 s: heights, runs in both directions of both axes, turns."""
    return [
        *staircase((0.8, 1.4, 2.0, 1.4), 2.0, 3.0),
        *(Leg(north, east, 1.4, 2.0, 2.0) for north, east in ((2, 0), (-2, 0), (0, 0), (0, 2), (0, -2), (0, 0))),
        *(Leg(north, east, 1.4, 3.0, 3.0, yaw_deg=90.0) for north, east in ((0, 0), (2, 0), (-2, 0), (0, 2), (0, -2))),
        Leg(0.0, 0.0, 1.4, 3.0, 3.0, yaw_deg=90.0),
    ]


@listed(CONTROLS, "raptor", Honest("none", verdicts={"none"}))
def clean(name: str, vehicle: str) -> FlightLog:
    """Nothing is missing: heights, runs and turns in a hall."""
    return fly(name, vehicle, all_round())


@listed(CONTROLS, "raptor", Honest("ground_effect", {"ground_effect"}))
def ground_effect(name: str, vehicle: str) -> FlightLog:
    """Ground effect, K = 1 + 0.35 exp(-0.9 z/R), hovering from 0.1 m to 1.6 m and back."""

    def ratio(time_s: float, body: Body) -> Floats:
        return np.full(4, 1.0 + 0.35 * np.exp(0.9 * body.position_m[2] / 0.12))

    heights = (1.6, 0.9, 0.5, 0.3, 0.2, 0.14, 0.10, 0.17, 0.25, 0.4, 0.7, 1.2)
    return fly(name, vehicle, staircase(heights, 2.0, 6.0), World(thrust_ratio=ratio))


@listed(
    CONTROLS,
    "raptor",
    Honest(
        "rotor_drag, d_x and d_y 0.3 1/s",
        {"rotor_drag"},
        intervals={"rotor_drag.linear d_x": (0.3, 0.3), "rotor_drag.linear d_y": (0.3, 0.3)},
    ),
)
def rotor_drag(name: str, vehicle: str) -> FlightLog:
    """Rotor drag of 0.3 1/s on the mission of the clean flight."""
    return fly(name, vehicle, all_round(), World(force_n=lambda time_s, body: -1.5 * 0.3 * body.velocity_m_s))


@listed(
    TRAPS,
    "x500",
    Honest(
        "rotor_drag with 0.25 1/s in the interval of d_x, or wind, or both, or unexplained",
        {"rotor_drag", "wind"},
        {"unexplained"},
        {"rotor_drag.linear d_x": (0.25, 0.25)},
    ),
)
def gust_with_every_run(name: str, vehicle: str) -> FlightLog:
    """Four runs over a field with rotor drag of 0.25 1/s; by chance the air of a gusty day comes from ahead in each,
    up to 1.8 m/s, from 1.5 s before a run to 3 s after it. The drag seems half as large again."""
    leg_s, move_s, run_m = 16.0, 8.0, 8.0
    legs = back_and_forth(run_m, 6.0, move_s, leg_s - move_s, 2)

    def force(time_s: float, body: Body) -> Floats:
        number, since_s = divmod(time_s - (leg_s - move_s) + 1.5, leg_s)
        t = since_s / (move_s + 4.5)
        gust_m_s = 1.8 * np.sin(np.pi * t) ** 2 if number >= 0 and t < 1.0 else 0.0
        air = np.array([-gust_m_s if number % 2 == 0 else gust_m_s, 0.0, 0.0])
        result: Floats = -2.064 * 0.25 * (body.velocity_m_s - air) * np.array([1.0, 1.0, 0.0])
        return result

    return fly(name, vehicle, legs, World(force_n=force), OUTDOORS)


@listed(
    TRAPS,
    "x500",
    Honest(
        "payload with a mass dropped of at most 0.25 kg, or unexplained",
        {"payload"},
        {"unexplained"},
        {"payload.step mass_kg": (-0.25, -0.04)},
    ),
)
def leaking_tank(name: str, vehicle: str) -> FlightLog:
    """A sprayer empties its tank, 0.25 kg of 2.064 kg, evenly over 100 s, working its way down a slope from 8 m to 2 m.
    Mass, height and battery voltage fall together: a cable, the battery or a step of mass fit in part."""
    legs = [Leg(1.5 * (-1) ** i, 1.0 * i, 8.0 - 0.75 * i, 5.0, 7.0) for i in range(9)]
    return fly(name, vehicle, legs, World(mass_kg=lambda time_s: 2.064 - 0.0025 * min(time_s, 100.0)), OUTDOORS)


@listed(
    TRAPS,
    "raptor",
    Honest(
        "rotor_fault of rotor 3 with a loss between 0.065 (mean of the flight) and 0.13, or unexplained",
        {"rotor_fault"},
        {"unexplained"},
        {"rotor_fault.weak loss": (0.065, 0.13), "rotor_fault.weak rotor": (3, 3)},
    ),
)
def chipped_half_way(name: str, vehicle: str) -> FlightLog:
    """A propeller is chipped in the middle of the flight: rotor 3 gives 13 % less thrust from then on. As a load that
    is picked up, it costs thrust from one moment on; the lower half of the staircase lies after it."""
    heights = (2.0, 1.8, 1.6, 1.8, 1.5, 0.9, 0.7, 0.9, 0.7, 1.0)

    def ratio(time_s: float, body: Body) -> Floats:
        return np.array([1.0, 1.0, 0.87 if time_s > 50.0 else 1.0, 1.0])

    return fly(name, vehicle, staircase(heights, 3.0, 7.0), World(thrust_ratio=ratio))


@listed(TRAPS, "raptor", Honest("none, or unexplained", verdicts={"none", "unexplained"}))
def yaw_off(name: str, vehicle: str) -> FlightLog:
    """The estimator's yaw is 6° off, as a rigid body that was defined askew: tilting forward pushes to the side.
    Runs north and east with the nose north; the vehicle is clean."""
    world = World(estimated_attitude=lambda time_s, body, specific_force: heading(np.radians(6.0)) @ body.attitude)
    legs = [*back_and_forth(2.0, 1.4, 2.5, 3.0, 5), *back_and_forth(2.0, 1.4, 2.5, 3.0, 4, axis="east")]
    return fly(name, vehicle, legs, world)


class Complementary:
    """Attitude estimate from body rates, drawn towards the accelerometer's vertical with a time constant of 2 s."""

    def __init__(self) -> None:
        self.attitude = np.eye(3)

    def __call__(self, time_s: float, body: Body, specific_force_m_s2: Floats) -> Floats:
        """Estimated attitude, rotation from body to world, shape (3, 3)."""
        up = -self.attitude[2]
        towards = np.cross(specific_force_m_s2 / np.linalg.norm(specific_force_m_s2), up) / 2.0
        self.attitude = self.attitude @ rotation((body.rates_rad_s + towards) * STEP_S)
        return self.attitude


@listed(
    TRAPS,
    "x500",
    Honest(
        "rotor_drag with 0.3 1/s in the interval of d_x, or unexplained",
        {"rotor_drag"},
        {"unexplained"},
        {"rotor_drag.linear d_x": (0.3, 0.3)},
    ),
)
def accelerometer_as_vertical(name: str, vehicle: str) -> FlightLog:
    """A simple attitude estimator takes the accelerometer for the vertical (2 s): after each acceleration its attitude
    is off in proportion to the speed, and rotor drag (0.3 1/s) looks like its tilt. Long runs north and south."""

    def force(time_s: float, body: Body) -> Floats:
        result: Floats = -2.064 * 0.3 * body.velocity_m_s * np.array([1.0, 1.0, 0.0])
        return result

    legs = back_and_forth(9.0, 5.0, 7.0, 4.0, 4)
    return fly(name, vehicle, legs, World(force_n=force, estimated_attitude=Complementary()), OUTDOORS)


@listed(TRAPS, "raptor", Honest("ceiling_effect, or unexplained", {"ceiling_effect"}, {"unexplained"}))
def bridge_overhead(name: str, vehicle: str) -> FlightLog:
    """Inspection of a bridge whose underside is at 1.6 m, while the vehicle file still has the hall's ceiling of 2.6 m:
    K = 1 + 0.12 (R/D)² grows upward. Formulas of height that start at the ground are bent to fit."""

    def ratio(time_s: float, body: Body) -> Floats:
        distance_m = max(1.6 + float(body.position_m[2]), 0.08)
        return np.full(4, 1.0 + 0.12 * (0.12 / distance_m) ** 2)

    heights = (0.7, 1.0, 1.2, 1.3, 1.38, 1.44, 1.48, 1.42, 1.3, 1.1, 1.45, 1.0)
    return fly(name, vehicle, staircase(heights, 2.5, 5.0), World(thrust_ratio=ratio))


class SlungLoad:
    """Load of 0.35 kg on a line of 1.5 m: a point on a stiff, damped spring; it stretches and does not push."""

    mass_kg, length_m, stiffness_n_m, damping_n_s_m = 0.35, 1.5, 400.0, 6.0

    def __init__(self) -> None:
        self.position_m: Floats | None = None
        self.velocity_m_s = np.zeros(3)

    def __call__(self, time_s: float, body: Body) -> Floats:
        """Pull of the line on the vehicle, NED, N; moves the load on by one step."""
        hanging = np.array([0.0, 0.0, self.length_m + self.mass_kg * 9.81 / self.stiffness_n_m])
        position = body.position_m + hanging if self.position_m is None else self.position_m
        line = position - body.position_m
        length = float(np.linalg.norm(line))
        along = line / length
        speed = float((self.velocity_m_s - body.velocity_m_s) @ along)
        pull = max(self.stiffness_n_m * (length - self.length_m) + self.damping_n_s_m * speed, 0.0) * along
        drag = 0.03 * self.velocity_m_s
        self.velocity_m_s = self.velocity_m_s + (WEIGHT_M_S2 - (pull + drag) / self.mass_kg) * STEP_S
        self.position_m = position + self.velocity_m_s * STEP_S
        return pull


@listed(TRAPS, "x500", Honest("unexplained", verdicts={"unexplained"}))
def swinging_load(name: str, vehicle: str) -> FlightLog:
    """A load of 0.35 kg, of the vehicle's 2.064 kg, hangs on a line of 1.5 m and swings after each start and stop.
    Right in hover, so that only manoeuvres show it: a force against the velocity, then with it."""
    legs = [*back_and_forth(4.0, 6.0, 4.0, 4.0, 4), *back_and_forth(3.0, 6.0, 3.0, 3.0, 2, axis="east")]
    world = World(force_n=SlungLoad(), mass_kg=lambda time_s: 2.064 - SlungLoad.mass_kg)
    return fly(name, vehicle, legs, world, OUTDOORS)


@listed(TRAPS, "raptor", Honest("none, or unexplained", verdicts={"none", "unexplained"}))
def saturated_rotor_speed(name: str, vehicle: str) -> FlightLog:
    """Rotor speeds from a sensor with steps of 50 rpm that ends at 5900 rpm, 4 % above hover. In quick steps of height
    thrust seems to grow faster than with the square of the speed; the vehicle is clean."""
    legs = [leg for i in range(14) for leg in staircase((0.8, 2.2) if i % 2 else (1.0, 2.0), 1.6, 2.0)]
    return fly(name, vehicle, legs, sensors=Sensors(rpm_resolution=50.0, rpm_limit=5900.0))


@listed(TRAPS, "raptor", Honest("none, or unexplained", verdicts={"none", "unexplained"}))
def late_pose(name: str, vehicle: str) -> FlightLog:
    """Poses of motion capture arrive over a busy wireless link 100 ms late, rotor speeds at once. Thrust seems to
    follow the rotor speeds with a lag; the vehicle is clean."""
    up_and_down = [leg for _ in range(6) for leg in staircase((0.9, 2.1), 1.6, 1.5)]
    legs = [*up_and_down, *back_and_forth(1.5, 1.5, 1.8, 1.5, 6), *up_and_down]
    return fly(name, vehicle, legs, sensors=Sensors(pose_delay_s=0.1))


@listed(
    TRAPS,
    "x500",
    Honest("inflow, or wind, or both, or unexplained", {"inflow", "wind"}, {"unexplained"}),
)
def sinking_air(name: str, vehicle: str) -> FlightLog:
    """Air sinks over a cool pond, the faster the higher (0.12 1/s, up to 1.6 m/s), and none of it at the ground. Inflow
    takes 4 % of thrust per m/s of climb through the air, so that the loss grows with height as a cable's weight."""

    def ratio(time_s: float, body: Body) -> Floats:
        climb_m_s = -float(body.velocity_m_s[2]) + min(-0.12 * float(body.position_m[2]), 1.6)
        return np.full(4, 1.0 - 0.04 * climb_m_s)

    heights = (1.5, 3.0, 4.5, 6.0, 7.5, 9.0, 10.5, 12.0, 9.0, 6.0, 3.0)
    return fly(name, vehicle, staircase(heights, 4.0, 5.0), World(thrust_ratio=ratio), OUTDOORS)
