"""Draws of whole cases: which vehicle flies where, with which controller, estimator, missions and hidden effects."""

import zlib
from dataclasses import replace

import numpy as np

from studies.worlds.field.arrays import Floats
from studies.worlds.field.cases import NOISE_STEP_S, Case, Control, Flight, Hidden, Sensing, noise_samples
from studies.worlds.field.hidden import DRAWS, FAMILIES
from studies.worlds.field.missions import Arena, draw_reference
from studies.worlds.field.noise import first_order_noise, gusts, passing_noise, smooth_noise
from studies.worlds.field.vehicles import Beliefs, Vehicle, draw_beliefs, draw_vehicle

SETTLE_S = 8.0
PAIRS: tuple[tuple[str, ...], ...] = (
    ("ground_effect", "rotor_drag"),
    ("wind", "thrust_scale"),
    ("rotor_drag", "inflow"),
    ("body_drag", "payload"),
    ("thrust_tilt", "rotor_drag"),
    ("ground_effect", "thrust_scale"),
    ("inflow+translational_lift",),
    ("rotor_fault", "body_drag"),
    ("tether", "thrust_tilt"),
)
NEEDS: dict[str, tuple[str, ...]] = {
    "ground_effect": ("low_passes", "hover_heights"),
    "rotor_drag": ("figure_eight", "sticks", "straight_runs"),
    "body_drag": ("straight_runs", "figure_eight"),
    "inflow": ("climbs", "bounces"),
    "translational_lift": ("straight_runs", "figure_eight"),
    "inflow+translational_lift": ("straight_runs", "climbs", "random_spline"),
    "wind": ("straight_runs", "sticks", "figure_eight"),
    "motor_lag": ("bounces", "sticks", "climbs"),
    "tether": ("climbs", "high_hovers"),
    "thrust_curve": ("bounces", "climbs", "sticks"),
    "rotor_interaction": ("straight_runs", "figure_eight"),
    "ceiling_effect": ("high_hovers", "climbs"),
}
FAST = ("body_drag", "translational_lift", "inflow+translational_lift", "wind", "rotor_interaction")
"""Effects that only wide and fast flights show."""
LIVELY = ("motor_lag", "thrust_curve")
"""Effects that only quick changes of thrust show."""
ANYWHERE = ("hover_heights", "figure_eight", "random_spline", "climbs", "bounces", "sticks", "still", "straight_runs")


def _mass(rng: np.random.Generator, least: float, most: float) -> float:
    return float(np.exp(rng.uniform(np.log(least), np.log(most))))


def _arena(
    rng: np.random.Generator, vehicle: Vehicle, place: str, recipe: tuple[str, ...], low: bool
) -> tuple[Arena, float | None]:
    """Draw the space of flight and the height of the ceiling, if there is one."""
    radius, offset = vehicle.radius_m, vehicle.rotor_height_m
    clear = 7.0 * radius
    if low:
        lowest = max(radius * rng.uniform(1.05, 1.5), 0.05 + 0.2 * radius) - offset
        lowest = max(lowest, 0.03)
    else:
        lowest = max(clear, 0.4)
    if place == "outdoor":
        fast = any(family in FAST for family in recipe)
        lively = any(family in LIVELY for family in recipe)
        width = rng.uniform(22.0, 45.0) if fast else rng.uniform(5.0, 15.0)
        speed = rng.uniform(8.0, 12.0) if fast else rng.uniform(3.0, 6.0)
        high = rng.uniform(8.0, 20.0)
        middle = rng.uniform(2.5, 4.0) if low else rng.uniform(4.0, 6.5)
        accel = rng.uniform(2.2, 3.8) + (1.2 if lively else 0.0)
        arena = Arena(width, lowest, middle, high, speed, rng.uniform(1.8, 3.2) + (1.0 if lively else 0.0), accel)
        return arena, None
    small = vehicle.mass_kg < 0.3
    ceiling = rng.uniform(2.4, 3.2) if small else rng.uniform(2.9, 4.5)
    if "ceiling_effect" in recipe:
        high = ceiling - offset - max(rng.uniform(1.0, 1.4) * radius, 0.07)
    else:
        high = ceiling - offset - max(clear, 0.4)
    middle = float(np.clip(rng.uniform(0.45, 0.6) * ceiling, lowest + 0.3, high - 0.3))
    width = rng.uniform(1.2, 2.2) if small else rng.uniform(1.8, 3.5)
    arena = Arena(width, lowest, middle, high, rng.uniform(1.4, 2.6), rng.uniform(0.8, 1.6), rng.uniform(2.0, 3.6))
    return arena, ceiling if "ceiling_effect" in recipe or rng.random() < 0.4 else None


def _sensing(rng: np.random.Generator, vehicle: Vehicle, place: str, recipe: tuple[str, ...]) -> Sensing:
    """Draw estimator and logger."""
    kind = str(rng.choice(["mocap", "mocap", "flow"])) if place == "indoor" else str(rng.choice(["gps", "gps", "flow"]))
    position = {"mocap": (0.0002, 0.001), "flow": (0.003, 0.012), "gps": (0.005, 0.02)}[kind]
    velocity = {"mocap": (0.005, 0.015), "flow": (0.015, 0.05), "gps": (0.02, 0.08)}[kind]
    log_rate = rng.choice([30.0, 40.0, 50.0, 50.0, 62.5, 100.0, 100.0])
    needs_speed = any(f in ("motor_lag", "thrust_curve", "inflow", "rotor_interaction") for f in recipe)
    rotor_rate = float(rng.choice([12.5, 20.0, 30.0, 50.0] if needs_speed else [3.0, 6.0, 10.0, 20.0, 30.0, 50.0]))
    if "motor_lag" in recipe:
        rotor_rate = float(rng.choice([25.0, 50.0]))
    bias = rng.normal(0.0, 0.012, 3)
    return Sensing(
        kind=kind,
        position_sigma_m=rng.uniform(*position),
        position_time_s=rng.uniform(0.05, 0.15) if kind == "mocap" else rng.uniform(0.4, 2.5),
        velocity_sigma_m_s=rng.uniform(*velocity),
        velocity_time_s=rng.uniform(0.04, 0.1) if kind == "mocap" else rng.uniform(0.1, 0.5),
        velocity_lag_s=rng.uniform(0.015, 0.045),
        attitude_sigma_deg=rng.uniform(0.02, 0.06) if kind == "mocap" else rng.uniform(0.04, 0.12),
        tilt_per_accel_deg=rng.uniform(0.0, 0.06) if kind == "mocap" else rng.uniform(0.02, 0.25),
        tilt_time_s=rng.uniform(0.05, 0.6),
        drift_deg=rng.uniform(0.05, 0.1) if kind == "mocap" else rng.uniform(0.08, 0.16),
        yaw_bias_deg=rng.normal(0.0, 0.2) if kind == "mocap" else rng.normal(0.0, 0.7),
        gyro_lag_s=rng.uniform(0.002, 0.005),
        rotor_delay_s=rng.uniform(-0.010, 0.035),
        rotor_rate_hz=min(rotor_rate, float(log_rate)),
        rpm_quantum=vehicle.hover_rpm * rng.uniform(0.0005, 0.006),
        log_rate_hz=float(log_rate),
        hold_rate_hz=float(rng.choice([25.0, 30.0])) if log_rate >= 50.0 and rng.random() < 0.25 else 0.0,
        missing_rows=rng.uniform(0.0, 0.01),
        repeated_rows=rng.uniform(0.0, 0.006),
        imu="imu_bias" in recipe or bool(rng.random() < 0.3),
        imu_bias_m_s2=bias,
        imu_noise_m_s2=rng.uniform(0.08, 0.35),
        imu_lag_s=rng.uniform(0.002, 0.008),
        battery_column="battery_sag" in recipe or bool(rng.random() < 0.3),
        command_columns="battery_sag" in recipe or bool(rng.random() < 0.25),
        rotor_columns="battery_sag" not in recipe,
    )


def _control(rng: np.random.Generator, vehicle: Vehicle, sensing: Sensing) -> Control:
    """Draw a controller whose bandwidths fit the motors and the lags of the estimator."""
    kind = str(rng.choice(["geometric", "lqr", "indi"]))
    quick = vehicle.mass_kg < 0.3
    inner = 400 if quick else int(rng.choice([200, 400]))
    outer = int(rng.choice([100, 200])) if quick or kind == "indi" else int(rng.choice([50, 100]))
    usual_lead = float(rng.choice([0.0, 0.3]))
    lead = 0.5 if vehicle.motor_time_s > 0.05 else usual_lead
    delay = vehicle.motor_time_s * (1.0 - lead) + 1.0 / inner + sensing.gyro_lag_s + 0.003
    if kind == "indi":
        delay += 0.006
    rate = float(np.clip(0.42 / delay, 3.0, 26.0))
    attitude = min(rate / 3.3, 8.0)
    flat = min(attitude / 3.0, 2.2, 0.09 / sensing.velocity_lag_s) * rng.uniform(0.8, 1.0)
    up = min(0.17 / (vehicle.motor_time_s * (1.0 - lead) + sensing.velocity_lag_s + 1.0 / outer), 3.5)
    return Control(
        kind=kind,
        inner_hz=inner,
        outer_hz=outer,
        rate_gain=rate,
        attitude_gain=attitude,
        flat_bandwidth=float(flat),
        up_bandwidth=float(up * rng.uniform(0.8, 1.0)),
        damping=float(rng.uniform(0.8, 1.1)),
        integral_time_s=float(rng.uniform(2.0, 3.5) / max(flat, 0.3) * 1.5),
        feedforward=0.0 if kind == "lqr" else 1.0,
        lead=lead,
        max_tilt_rad=float(np.radians(rng.uniform(30.0, 38.0))),
    )


def _plan(rng: np.random.Generator, recipe: tuple[str, ...], place: str, number: int, low: bool) -> list[str]:
    """Draw the segments of one flight: first what the hidden effects need to be seen, then anything."""
    needed: list[str] = []
    for family in recipe:
        wanted = list(NEEDS.get(family, ()))
        rng.shuffle(wanted)
        needed += wanted[: 3 if number == 0 else 2]
    others = list(rng.permutation([name for name in ANYWHERE if name != "straight_runs" or place == "outdoor"]))
    if low and "low_passes" not in needed and not needed:
        needed = ["low_passes"]
    if number > 0 and rng.random() < 0.4:
        needed = needed[:1]
    return [*needed, *[str(name) for name in others[: 4 - min(len(needed), 2)]]]


def _flights(
    rng: np.random.Generator,
    vehicle: Vehicle,
    arena: Arena,
    sensing: Sensing,
    place: str,
    recipe: tuple[str, ...],
    hidden: tuple[Hidden, ...],
    low: bool,
) -> tuple[tuple[Flight, ...], Floats]:
    """Draw two or three flights and the trim of the vehicle (roll, pitch in degrees)."""
    count = int(rng.choice([2, 2, 3]))
    wind = np.zeros(3)
    sheared = False
    for effect in hidden:
        if effect.variant == "wind.mean":
            wind = np.array([effect.parameters["north_m_s"], effect.parameters["east_m_s"], 0.0])
            sheared = effect.parameters["sheared"] > 0.5
    towards = rng.uniform(-np.pi, np.pi)
    trim = rng.uniform(0.1, 0.38) * np.array([np.cos(towards), np.sin(towards)])
    # Turbulence of a place, larger where the mean wind is: drawn for the wind at full strength.
    sigma = rng.uniform(0.0, 0.1) if place == "indoor" else rng.uniform(0.05, 0.6)
    coupling = rng.uniform(0.15, 0.3)
    changed = next((h.parameters["relative"] for h in hidden if "payload" in h.families), 0.0)
    changed_flight = int(rng.integers(0, count))
    charges = np.array([rng.uniform(0.85, 1.0), rng.uniform(0.5, 0.75), rng.uniform(0.3, 0.5)])
    flights = []
    for number in range(count):
        heading = str(rng.choice(["north", "held", "turning", "steps"]))
        duration = rng.uniform(50.0, 90.0)
        reference = draw_reference(rng, arena, _plan(rng, recipe, place, number, low), duration, heading, SETTLE_S)
        samples = noise_samples(duration + SETTLE_S)
        drift = first_order_noise(rng, samples, NOISE_STEP_S, sensing.drift_deg, rng.uniform(15.0, 40.0), 2)
        quick = smooth_noise(rng, samples, NOISE_STEP_S, sensing.attitude_sigma_deg, 0.06, 3)
        tilt = np.radians(quick + np.concatenate([drift, np.zeros((samples, 1))], axis=1))
        shift = rng.normal(0.0, 0.08, 2)
        flights.append(
            Flight(
                reference=reference,
                settle_s=SETTLE_S,
                mean_wind_m_s=wind,
                shear=sheared,
                gusts_m_s=gusts(rng, samples, NOISE_STEP_S, sigma, float(np.linalg.norm(wind)), arena.middle_m),
                gust_coupling_per_s=coupling,
                position_noise_m=smooth_noise(
                    rng, samples, NOISE_STEP_S, sensing.position_sigma_m, sensing.position_time_s, 3
                ),
                velocity_noise_m_s=passing_noise(
                    rng, samples, NOISE_STEP_S, sensing.velocity_sigma_m_s, sensing.velocity_time_s, 3
                ),
                tilt_noise_rad=tilt,
                trim_rad=np.radians(np.append(trim + shift, sensing.yaw_bias_deg)),
                mass_change=changed if number == changed_flight else 0.0,
                mass_change_at_s=rng.uniform(0.35, 0.65) * duration,
                mass_change_takes_s=rng.uniform(0.05, 0.5),
                charge=float(charges[number]),
                seed=int(rng.integers(2**31)),
            )
        )
    return tuple(flights), trim


def draw_case(name: str, recipe: tuple[str, ...], index: int, strength: float, seed: int, low: bool = False) -> Case:
    """Draw one case; vehicle, missions and noise depend on name and seed only, so that strengths can be compared."""
    rng = np.random.default_rng([seed, zlib.crc32(name.encode())])
    low = low or "ground_effect" in recipe
    if any(family in FAST for family in recipe) or "payload" in recipe:
        place = "outdoor"
    elif "ceiling_effect" in recipe or (low and rng.random() < 0.6):
        place = "indoor"
    else:
        place = str(rng.choice(["indoor", "outdoor"]))
    lagging = "motor_lag" in recipe
    if any(family in LIVELY for family in recipe):
        place = "outdoor"
    mass = _mass(rng, 0.4, 10.0) if place == "outdoor" else _mass(rng, 0.03, 2.2)
    if lagging:
        mass = max(mass, 1.0)
    if "ceiling_effect" in recipe:
        mass = _mass(rng, 0.3, 2.2)
    rotors = 6 if mass > 0.8 and rng.random() < 0.25 else 4
    lag = float(rng.uniform(0.06, 0.14)) * strength if lagging else None
    vehicle = draw_vehicle(rng, name.replace("_", "-"), mass, rotors, lag)
    if "battery_sag" in recipe:
        vehicle = replace(
            vehicle, battery_c_rate=float(rng.uniform(12.0, 20.0)), motor_time_s=min(vehicle.motor_time_s, 0.03)
        )
    arena, ceiling = _arena(rng, vehicle, place, recipe, low)
    hidden: tuple[Hidden, ...] = ()
    for family in recipe:
        hidden += DRAWS[family](rng, vehicle, arena, strength, index)
    sensing = _sensing(rng, vehicle, place, recipe)
    for effect in hidden:
        if "imu_bias" in effect.families:
            bias = np.array([effect.parameters[f"{axis}_m_s2"] for axis in "xyz"])
            sensing = replace(sensing, imu_bias_m_s2=bias)
    control = _control(rng, vehicle, sensing)
    if "ceiling_effect" in recipe:
        # The pull of a ceiling grows towards it: a softer height loop would let the vehicle be drawn up.
        control = replace(control, up_bandwidth=max(control.up_bandwidth, 5.0))
    beliefs = _mistaken(draw_beliefs(rng, vehicle), hidden)
    states_motor_time = not lagging and ("battery_sag" in recipe or bool(rng.random() < 0.6))
    flights, trim = _flights(rng, vehicle, arena, sensing, place, recipe, hidden, low)
    tilt = np.zeros(2)
    for effect in hidden:
        if "thrust_tilt" in effect.families:
            tilt = np.array([effect.parameters["roll_deg"], effect.parameters["pitch_deg"]])
    notes: tuple[str, ...] = (f"{place}, {sensing.kind}, {control.kind} control, {rotors} rotors, {mass:.3g} kg",)
    if low and not hidden:
        notes += ("low flight over a net that lets the downwash through",)
    if "ground_effect" in recipe:
        notes += ("each rotor feels its own height, so that ground_torque is a consequence of the same effect",)
    return Case(
        name=name,
        vehicle=vehicle,
        beliefs=beliefs,
        control=control,
        sensing=sensing,
        hidden=hidden,
        flights=flights,
        strength=strength,
        trims_deg=float(np.hypot(*(tilt - trim))),
        ceiling_m=ceiling,
        states_motor_time=states_motor_time,
        notes=notes,
    )


def _mistaken(beliefs: Beliefs, hidden: tuple[Hidden, ...]) -> Beliefs:
    """Beliefs with the error of a hidden `thrust_scale`: true over believed thrust per mass is its factor."""
    for effect in hidden:
        if effect.variant == "thrust_scale.coefficient":
            wrong = beliefs.thrust_n_per_rpm2 / effect.parameters["factor"]
            return Beliefs(beliefs.mass_kg, wrong, beliefs.inertia_kg_m2)
        if effect.variant == "thrust_scale.mass":
            wrong = beliefs.mass_kg * effect.parameters["factor"]
            return Beliefs(wrong, beliefs.thrust_n_per_rpm2, beliefs.inertia_kg_m2)
    return beliefs


def draw_world(strength: float, seed: int, only: str | None = None) -> list[Case]:
    """Draw the default set: three cases of each family, twelve clean ones and the pairs."""
    recipes: list[tuple[str, tuple[str, ...], int, bool]] = []
    for family in FAMILIES:
        recipes += [(f"{family}_{number + 1}", (family,), number, False) for number in range(3)]
    recipes += [(f"clean_{number + 1:02d}", (), number, number % 4 == 3) for number in range(12)]
    # Other forms than in the single cases.
    recipes += [
        ("pair_" + "_".join(pair).replace("+", "_"), pair, number + number // 5 + 3, False)
        for number, pair in enumerate(PAIRS)
    ]
    return [
        draw_case(name, recipe, index + seed, strength, seed, low)
        for name, recipe, index, low in recipes
        if only is None or only in name
    ]
