"""Hidden effects: what each family does to the forces and moments of many flights at once.

An effect changes the thrust of rotors by factors, or adds forces and moments. Its published form is named beside it.
Families that act on a motor, a sensor or a command (`battery_sag`, `motor_lag`, `thrust_map`, `imu_bias`, and
`thrust_tilt` of the form `board`) have no function here; the flight itself holds them.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from studies.worlds.blade.rotation import Array, rotate_back
from studies.worlds.blade.rotors import Blades, thrust_ratio, thrust_ratio_reduced_inflow
from studies.worlds.blade.vehicles import GRAVITY

Values = Mapping[str, Array]
CONSTANT = {"anchor_m", "decay", "free_m", "moment_s", "rotor"}
"""Values that do not grow with the strength."""


@dataclass(frozen=True)
class Effect:
    """One hidden effect: family, form, values at strength 1, and those that the strength multiplies."""

    family: str
    form: str
    values: dict[str, float | list[float]]
    powers: Mapping[str, float] = field(default_factory=dict)
    """Power of the strength by which each value grows; for those that are not named 1, or 0 for `CONSTANT` ones."""

    def at(self, strength: float) -> "Effect":
        """Same effect at another strength."""
        powers = {name: self.powers.get(name, float(name not in CONSTANT)) for name in self.values}
        values = {name: np.multiply(value, strength ** powers[name]).tolist() for name, value in self.values.items()}
        return Effect(self.family, self.form, values, self.powers)


@dataclass
class Situation:
    """State of some flights that forces depend on; world axes north, east, down, body axes forward, right, down."""

    time: Array
    speed: Array
    """Rotor speeds, rad/s; 1 where there is no rotor."""
    rotation: Array
    position: Array
    airspeed: Array
    """Velocity of the vehicle relative to the air, body axes."""
    rates: Array
    places: Array
    """Positions of the rotors in the body."""
    blades: Blades
    k: Array
    present: Array
    """True where there is a rotor."""
    height: Array
    """Height of each rotor's hub above the ground."""
    ceiling: Array
    mass: Array
    hover_speed: Array
    hover_induced: Array
    arm: Array

    def of(self, lanes: Array) -> "Situation":
        """Part of the situation."""
        b = self.blades
        blades = Blades(b.radius_m[lanes], b.air_density[lanes], b.lift[lanes], b.pitch_rad[lanes])
        parts = {name: getattr(self, name)[lanes] for name in self.__dataclass_fields__ if name != "blades"}
        return Situation(blades=blades, **parts)

    @property
    def edge(self) -> Array:
        """Edgewise airspeed of the rotors."""
        edge: Array = np.sqrt(self.airspeed[:, :1] ** 2 + self.airspeed[:, 1:2] ** 2)
        return edge

    @property
    def ideal(self) -> Array:
        """Thrust k omega^2 of each rotor."""
        return np.where(self.present, self.k * self.speed**2, 0.0)


@dataclass
class Change:
    """Changes by effects: factors of thrust, forces in body and world axes, moments in body axes, added mass."""

    factor: Array
    body: Array
    world: Array
    moment: Array
    added_mass: Array
    tilt: Array
    """Direction of the thrust over its upward part, forward and right."""

    @classmethod
    def none(cls, flights: int, rotors: int) -> "Change":
        """Change that changes nothing."""
        zero = np.zeros((flights, 3))
        return cls(
            np.ones((flights, rotors)), zero, zero.copy(), zero.copy(), np.zeros(flights), np.zeros((flights, 2))
        )


def _column(values: Values, name: str) -> Array:
    return values[name][:, None]


def _washed_out(s: Situation) -> Array:
    """Share of a ground effect that is left at speed (Cheeseman and Bennett 1955)."""
    share: Array = 1.0 / (1.0 + (s.edge / s.hover_induced[:, None]) ** 2)
    return share


def _images(s: Situation, height: Array) -> Array:
    """Share of the induced velocity that the image sources of all rotors take away at each rotor.

    R^2 / 2 h / (d^2 + 4 h^2)^1.5 for a rotor at distance d (terms of Sanchez-Cuevas et al. 2017); (R / 4h)^2 for d = 0.
    """
    gap = s.places[:, :, None, :2] - s.places[:, None, :, :2]
    distance2 = (gap**2).sum(-1)
    mean = 0.5 * (height[:, :, None] + height[:, None, :])
    weight = s.present[:, None, :] * 0.5 * s.blades.radius_m[:, :, None] ** 2
    share: Array = (weight * mean / (distance2 + 4.0 * mean**2) ** 1.5).sum(-1)
    return share


def ground_images(s: Situation, v: Values, out: Change) -> None:
    """Ground effect by image sources in the blade elements' inflow; `gain`: experiments find more than the images."""
    height = np.maximum(s.height, 0.3 * s.blades.radius_m)
    reduction = _column(v, "gain") * _images(s, height) * _washed_out(s)
    out.factor *= thrust_ratio_reduced_inflow(s.blades, reduction)


def ground_hayden(s: Situation, v: Values, out: Change) -> None:
    """Ground effect by Hayden 1976, K = (0.9926 + 0.03794 / (z / 2R)^2)^(2/3), divided by its value far away."""
    over = np.maximum(s.height / (2.0 * s.blades.radius_m), 0.2)
    ratio = ((0.9926 + 0.03794 / over**2) / 0.9926) ** (2.0 / 3.0)
    out.factor *= 1.0 + _column(v, "gain") * (ratio - 1.0) * _washed_out(s)


def ground_danjun(s: Situation, v: Values, out: Change) -> None:
    """Ground effect by Danjun et al. 2015, 1 / (1 - rho (R / 4z)^2)."""
    over = np.maximum(s.height / s.blades.radius_m, 0.4)
    share = np.minimum(_column(v, "rho") / (16.0 * over**2), 0.6) * _washed_out(s)
    out.factor /= 1.0 - share


def _below(s: Situation) -> Array:
    """Distance of the hubs from the ceiling, in radii."""
    below: Array = np.maximum((s.ceiling[:, None] - s.height) / s.blades.radius_m, 0.45)
    return below


def ceiling_contact(s: Situation, v: Values, out: Change) -> None:
    """Ceiling effect by Jimenez-Cano et al. 2019, 1 / (1 - 1/a1 (R / (z + a2))^2), a1 = 6.924, a2 = -0.01782."""
    share = np.minimum((_below(s) - 0.01782) ** -2 / 6.924, 0.6)
    out.factor *= 1.0 + _column(v, "gain") * (1.0 / (1.0 - share) - 1.0)


def ceiling_images(s: Situation, v: Values, out: Change) -> None:
    """Ceiling effect by image sinks in the blade elements' inflow."""
    reduction = _column(v, "gain") * _images(s, _below(s) * s.blades.radius_m)
    out.factor *= thrust_ratio_reduced_inflow(s.blades, reduction)


def ceiling_decay(s: Situation, v: Values, out: Change) -> None:
    """Ceiling effect that decays exponentially with the gap in radii."""
    out.factor *= 1.0 + _column(v, "gain") * np.exp(-_column(v, "decay") * _below(s))


def inflow_blades(s: Situation, v: Values, out: Change) -> None:
    """Thrust in axial flight by blade elements and momentum; each rotor sees its own climb as the body turns."""
    climb = -(s.airspeed[:, 2:] + s.rates[:, :1] * s.places[:, :, 1] - s.rates[:, 1:2] * s.places[:, :, 0])
    climb = np.maximum(climb, -0.7 * s.hover_induced[:, None])
    ratio = thrust_ratio(s.blades, s.speed, np.zeros_like(climb), climb)
    out.factor *= 1.0 + _column(v, "share") * (ratio - 1.0)


def edgewise_blades(s: Situation, v: Values, out: Change) -> None:
    """Translational lift by blade elements and Glauert's momentum theory."""
    edge = np.broadcast_to(s.edge, s.speed.shape)
    ratio = thrust_ratio(s.blades, s.speed, edge, np.zeros_like(edge))
    out.factor *= 1.0 + _column(v, "share") * (ratio - 1.0)


def drag_speed(s: Situation, v: Values, out: Change) -> None:
    """H-force of flapping and induced drag: rotor speed times airspeed in the rotor plane (Bristeau et al. 2009;
    Mahony et al. 2012). `rate` is drag over mass and airspeed in hover, 1/s."""
    whole = np.where(s.present, s.speed, 0.0).sum(-1) / (s.present.sum(-1) * s.hover_speed)
    out.body[:, :2] -= (v["rate"] * s.mass * whole)[:, None] * s.airspeed[:, :2]


def drag_thrust(s: Situation, v: Values, out: Change) -> None:
    """H-force in proportion to thrust and airspeed in the rotor plane (Martin and Salaun 2010)."""
    whole = s.ideal.sum(-1) / GRAVITY
    out.body[:, :2] -= (v["rate"] * whole)[:, None] * s.airspeed[:, :2]


def drag_axes(s: Situation, v: Values, out: Change) -> None:
    """Rotor drag D v with a value per body axis (Faessler et al. 2018)."""
    out.body -= v["rates"] * s.mass[:, None] * s.airspeed


def body_bluff(s: Situation, v: Values, out: Change) -> None:
    """Drag of a bluff body, |v| v. `per_metre` is rho C_D A / (2 m)."""
    size = np.sqrt((s.airspeed**2).sum(-1))
    out.body -= (v["per_metre"] * s.mass * size)[:, None] * s.airspeed


def body_plates(s: Situation, v: Values, out: Change) -> None:
    """Drag of three flat plates across the body axes, |v_i| v_i (equivalent flat-plate areas, Leishman chapter 5)."""
    out.body -= v["per_metre"] * s.mass[:, None] * np.abs(s.airspeed) * s.airspeed


def body_frontal(s: Situation, v: Values, out: Change) -> None:
    """Drag with an area per body axis and the whole airspeed, |v| v_i."""
    size = np.sqrt((s.airspeed**2).sum(-1))
    out.body -= v["per_metre"] * (s.mass * size)[:, None] * s.airspeed


def scale(s: Situation, v: Values, out: Change) -> None:
    """Thrust coefficient other than the file's by a constant share: air density, propeller, calibration."""
    out.factor *= 1.0 + _column(v, "share")


def curve_power(s: Situation, v: Values, out: Change) -> None:
    """Thrust by the power 2 + `excess` of rotor speed, equal in hover: lift and drag change with Reynolds number."""
    out.factor *= (s.speed / s.hover_speed[:, None]) ** _column(v, "excess")


def curve_mixed(s: Situation, v: Values, out: Change) -> None:
    """Thrust as a mixture of omega^2 and omega, equal in hover: propellers at low Reynolds number."""
    share = _column(v, "linear")
    out.factor *= 1.0 - share + share * s.hover_speed[:, None] / s.speed


def tilt_motors(s: Situation, v: Values, out: Change) -> None:
    """Rotor axes that all lean forward and right by angles."""
    out.tilt += v["angles_rad"]


def payload_step(s: Situation, v: Values, out: Change) -> None:
    """Mass that changes at a moment, over a third of a second as a gripper opens or a line comes taut."""
    progress = np.clip((s.time - v["moment_s"]) / 0.3, 0.0, 1.0)
    out.added_mass += v["share"] * s.mass * progress * progress * (3.0 - 2.0 * progress)


def _outward(s: Situation, v: Values) -> tuple[Array, Array]:
    """Height of the vehicle above the end of the cable, and the way from there to the vehicle."""
    way = s.position[:, :2] - v["anchor_m"]
    return np.maximum(-s.position[:, 2] - v["free_m"], 0.0), way


def tether_slack(s: Situation, v: Values, out: Change) -> None:
    """Cable that lies on the ground and is lifted straight: its weight per metre times height."""
    height, _ = _outward(s, v)
    out.world[:, 2] += v["weight_per_metre"] * s.mass * height


def tether_straight(s: Situation, v: Values, out: Change) -> None:
    """Cable from an anchor, nearly straight: its weight grows with its length, and half of the weight of what leans
    pulls along the chord (parabolic cable)."""
    height, way = _outward(s, v)
    distance = np.sqrt((way**2).sum(-1))
    length = np.sqrt(height**2 + distance**2)
    weight = v["weight_per_metre"] * s.mass * length
    pull = 0.3 * weight * distance / np.maximum(length, 0.1)
    out.world[:, 2] += weight
    out.world[:, :2] -= (pull / np.maximum(distance, 0.1))[:, None] * way


def fault(s: Situation, v: Values, out: Change) -> None:
    """Rotor that gives less thrust, from a moment on: chipped blade, slipping hub."""
    hit = np.arange(s.speed.shape[1])[None, :] == _column(v, "rotor")
    begun = np.clip((s.time - v["moment_s"]) / 0.1, 0.0, 1.0)[:, None]
    out.factor *= 1.0 - np.where(hit, _column(v, "loss") * begun, 0.0)


def ground_levelling(s: Situation, v: Values, out: Change) -> None:
    """Levelling moment near the ground: the lower side of a tilted vehicle lifts more. In proportion to thrust, arm,
    tilt and the slope of the ground effect, which falls exponentially with height."""
    height = np.where(s.present, s.height, 0.0).sum(-1, keepdims=True) / s.present.sum(-1, keepdims=True)
    over = height / s.blades.radius_m[:, :1]
    up = rotate_back(s.rotation, np.broadcast_to(np.array([0.0, 0.0, -1.0]), s.airspeed.shape))
    size = (v["gain"] * s.mass * GRAVITY * s.arm)[:, None] * np.exp(-over / _column(v, "decay"))
    out.moment[:, 0] += size[:, 0] * up[:, 1]
    out.moment[:, 1] -= size[:, 0] * up[:, 0]


def rear_wake(s: Situation, v: Values, out: Change) -> None:
    """Loss of rotors behind others in forward flight: front rotors' wakes bend back as speed grows past the induced
    velocity, and take thrust in proportion to how squarely a rotor stands behind (Powers et al. 2013, Theys 2016)."""
    edge = np.maximum(s.edge, 1e-6)
    course = s.airspeed[:, :2] / edge  # the vehicle moves this way through the air: what lies ahead is upstream
    gap = s.places[:, None, :, :2] - s.places[:, :, None, :2]  # from each rotor to each other one
    ahead = (gap * course[:, None, None, :]).sum(-1)
    aside = np.abs(gap[..., 0] * course[:, None, None, 1] - gap[..., 1] * course[:, None, None, 0])
    diameter = 2.0 * s.blades.radius_m[:, :, None]
    overlap = np.clip(1.0 - aside / diameter, 0.0, 1.0) * np.clip(ahead / diameter, 0.0, 1.0)
    covered = np.clip((overlap * s.present[:, None, :]).sum(-1), 0.0, 1.0)
    ratio = (s.edge / s.hover_induced[:, None]) ** 2
    out.factor *= 1.0 - _column(v, "loss") * covered * ratio / (1.0 + ratio)


Form = Callable[[Situation, Values, Change], None]
FORMS: dict[tuple[str, str], Form] = {
    ("ground_effect", "images"): ground_images,
    ("ground_effect", "hayden"): ground_hayden,
    ("ground_effect", "danjun"): ground_danjun,
    ("ceiling_effect", "contact"): ceiling_contact,
    ("ceiling_effect", "images"): ceiling_images,
    ("ceiling_effect", "decay"): ceiling_decay,
    ("inflow", "blades"): inflow_blades,
    ("translational_lift", "blades"): edgewise_blades,
    ("rotor_drag", "speed"): drag_speed,
    ("rotor_drag", "thrust"): drag_thrust,
    ("rotor_drag", "axes"): drag_axes,
    ("body_drag", "bluff"): body_bluff,
    ("body_drag", "plates"): body_plates,
    ("body_drag", "frontal"): body_frontal,
    ("wind", "rotor"): drag_thrust,  # the drag that makes a wind felt
    ("wind", "body"): body_bluff,
    ("wind", "alone"): lambda s, v, out: None,  # felt by the drag of another effect
    ("thrust_scale", "share"): scale,
    ("thrust_curve", "power"): curve_power,
    ("thrust_curve", "mixed"): curve_mixed,
    ("thrust_tilt", "motors"): tilt_motors,
    ("payload", "step"): payload_step,
    ("tether", "slack"): tether_slack,
    ("tether", "straight"): tether_straight,
    ("rotor_fault", "loss"): fault,
    ("ground_torque", "levelling"): ground_levelling,
    ("rotor_interaction", "wake"): rear_wake,
}


@dataclass
class Ensemble:
    """Effects of many flights, those of one form together."""

    groups: list[tuple[Form, Array, Values]] = field(default_factory=list)

    @classmethod
    def of(cls, flights: Sequence[Sequence[Effect]]) -> "Ensemble":
        """Ensemble of the effects of each flight."""
        found: dict[tuple[str, str], list[tuple[int, Effect]]] = {}
        for lane, effects in enumerate(flights):
            for effect in effects:
                if (effect.family, effect.form) in FORMS:
                    found.setdefault((effect.family, effect.form), []).append((lane, effect))
        groups: list[tuple[Form, Array, Values]] = []
        for key, members in found.items():
            values = {name: np.array([e.values[name] for _, e in members], float) for name in members[0][1].values}
            groups.append((FORMS[key], np.array([lane for lane, _ in members]), values))
        return cls(groups)

    def act(self, situation: Situation) -> Change:
        """Changes of all flights."""
        change = Change.none(*situation.speed.shape)
        for function, lanes, values in self.groups:
            part = Change.none(len(lanes), situation.speed.shape[1])
            function(situation.of(lanes), values, part)
            change.factor[lanes] *= part.factor
            for name in ("body", "world", "moment", "added_mass", "tilt"):
                getattr(change, name)[lanes] += getattr(part, name)
        return change
