"""Controllers of many flights at once: cascaded loops, geometric control on SE(3), and a person at the sticks."""

from dataclasses import dataclass

import numpy as np

from studies.worlds.blade.rotation import Array, conjugate, from_axes, matrix, multiply, to_vector
from studies.worlds.blade.vehicles import GRAVITY

CASCADE, GEOMETRIC, PERSON = 0, 1, 2


@dataclass(frozen=True)
class Tuning:
    """Gains of one flight."""

    kind: int
    position: list[float]
    """Position error to velocity, 1/s, sideways twice and vertically."""
    velocity: list[float]
    """Velocity error to acceleration, 1/s."""
    integral: list[float]
    attitude: float
    """Attitude error to body rate, 1/s."""
    rate: float
    """Rate error to angular acceleration, 1/s."""
    lead: float
    """Share of the reference's acceleration that is fed forward."""
    delay: float
    """Delay of what the controller sees, s; a person's reaction."""
    remnant: float
    """Noise that a person adds, m/s^2."""
    tilt: float
    """Greatest tilt, rad."""


def draw_tuning(rng: np.random.Generator, kind: int, time_constant: float, slow: float, *, stiff: bool) -> Tuning:
    """Gains that suit the motors' time constant, and an estimator that is `slow` seconds late; `stiff` vertically for
    flights next to a ceiling, which pulls the more the nearer it is.

    Each loop is about three times slower than the next inner one. A person follows the crossover model: the loop
    crosses over at about 0.8 rad/s with a delay of 0.2 to 0.3 s (McRuer and Jex 1967).
    """
    rate = min(0.5 / (time_constant + 0.01), 20.0) * rng.uniform(0.85, 1.1)
    attitude = rate * rng.uniform(0.3, 0.38)
    sideways = min(attitude * rng.uniform(0.36, 0.46), 0.4 / (slow + 0.05), 3.5)
    vertical = min(0.22 / (time_constant + 0.03), 0.4 / (slow + 0.05), 4.0) * rng.uniform(0.8, 1.0)
    velocity = np.array([sideways, sideways, 1.6 * vertical if stiff else vertical])
    position = velocity * rng.uniform(0.32, 0.42) * np.array([1.0, 1.0, 1.6 if stiff else 1.0])
    if kind == PERSON:
        velocity, position = np.minimum(velocity, rng.uniform(0.9, 1.1)), np.full(3, rng.uniform(0.25, 0.35))
        delay, remnant, lead = rng.uniform(0.2, 0.3), rng.uniform(0.1, 0.3), 0.0
    else:
        delay, remnant, lead = 0.0, 0.0, 1.0 if kind == GEOMETRIC else float(rng.choice([0.0, 0.7]))
    integral = velocity * rng.uniform(0.16, 0.24)
    return Tuning(
        kind=kind,
        position=position.tolist(),
        velocity=velocity.tolist(),
        integral=integral.tolist(),
        attitude=attitude,
        rate=rate,
        lead=lead,
        delay=delay,
        remnant=remnant,
        tilt=float(np.radians(38.0)),
    )


class Pilots:
    """Controllers of flights; `advance_outer` at 100 Hz, `advance_inner` at every tick."""

    def __init__(self, tunings: list[Tuning], mass: Array, inertia: Array, mixer: Array, largest: Array) -> None:
        """Controllers with their vehicles: mixer from (thrust, moments) to rotors, largest thrust of one rotor."""
        self._position = np.array([t.position for t in tunings])
        self._velocity = np.array([t.velocity for t in tunings])
        self._integral = np.array([t.integral for t in tunings])
        self._attitude = np.array([[t.attitude] for t in tunings])
        self._rate = np.array([[t.rate] for t in tunings])
        self._lead = np.array([[t.lead] for t in tunings])
        self._tilt = np.array([[t.tilt] for t in tunings])
        self._geometric = np.array([[t.kind == GEOMETRIC] for t in tunings])
        self._cascade = np.array([[t.kind == CASCADE] for t in tunings])
        self._mass, self._inertia, self._mixer, self._largest = mass, inertia, mixer, largest[:, None]
        flights = len(tunings)
        self._sum = np.zeros((flights, 3))
        self._rate_sum = np.zeros((flights, 3))
        self._force = np.tile([0.0, 0.0, -GRAVITY], (flights, 1)) * mass[:, None]
        self.attitude = np.tile([1.0, 0.0, 0.0, 0.0], (flights, 1))
        self.thrust = mass * GRAVITY

    def trim(self, acceleration: Array, angular: Array) -> None:
        """Integrators at what hover takes, as after some time in the air."""
        self._sum = np.clip(acceleration, -4.5, 4.5)
        self._rate_sum = np.clip(angular / (self._rate * np.array([1.0, 1.0, 0.5])), -2.5, 2.5)

    def advance_outer(
        self, position: Array, velocity: Array, reference: tuple[Array, Array, Array, Array], noise: Array, step: float
    ) -> None:
        """Wanted attitude and force from the estimated position and velocity."""
        goal, goal_rate, goal_acceleration, yaw = reference
        wanted = self._position * (goal - position)
        wanted = np.where(self._cascade, np.clip(wanted, -4.0, 4.0), np.clip(wanted, -6.0, 6.0)) + goal_rate
        error = wanted - velocity
        self._sum = np.clip(self._sum + self._integral * np.clip(error, -1.0, 1.0) * step, -4.5, 4.5)
        acceleration = self._velocity * error + self._sum + self._lead * goal_acceleration + noise
        up = np.clip(GRAVITY - acceleration[:, 2], 0.35 * GRAVITY, 2.2 * GRAVITY)
        sideways = acceleration[:, :2]
        size = np.sqrt((sideways**2).sum(-1, keepdims=True))
        sideways = sideways * np.minimum(1.0, np.tan(self._tilt) * up[:, None] / np.maximum(size, 1e-9))
        self._force = self._mass[:, None] * np.concatenate([sideways, -up[:, None]], axis=-1)
        z_body = -self._force / np.sqrt((self._force**2).sum(-1, keepdims=True))
        self.attitude = from_axes(z_body, yaw)

    def advance_inner(self, attitude: Array, rates: Array, step: float) -> Array:
        """Commanded thrust of each rotor, N, from the estimated attitude and body rates."""
        rotation = matrix(attitude)
        self.thrust = -(self._force * rotation[:, :, 2]).sum(-1)
        error = to_vector(multiply(conjugate(attitude), self.attitude))
        wanted_rotation = matrix(self.attitude)
        # e_R = 1/2 vee(R_d' R - R' R_d) (Lee et al. 2010, eq. 10); its negative has the sign of `error`.
        relative = np.swapaxes(wanted_rotation, -1, -2) @ rotation
        skewed = relative - np.swapaxes(relative, -1, -2)
        e_r = 0.5 * np.stack([skewed[:, 2, 1], skewed[:, 0, 2], skewed[:, 1, 0]], -1)
        error = np.where(self._geometric, -e_r, error)
        gain = self._attitude * np.array([1.0, 1.0, 0.5])
        rate_error = np.clip(gain * error, -3.5, 3.5) - rates
        self._rate_sum = np.clip(self._rate_sum + 0.3 * self._attitude * rate_error * step, -2.5, 2.5)
        weight = self._rate * np.array([1.0, 1.0, 0.5])
        angular = weight * (rate_error + self._rate_sum)
        moment = self._inertia * angular + np.where(self._geometric, np.cross(rates, self._inertia * rates), 0.0)
        demand = np.concatenate([self.thrust[:, None], moment], axis=-1)
        # Yaw gives way first where a rotor would saturate, as in PX4's mixer.
        without = (self._mixer[:, :, :3] @ demand[:, :3, None])[..., 0]
        yaw = self._mixer[:, :, 3] * demand[:, 3:]
        room = np.minimum(self._largest - without, without - 0.02 * self._largest).clip(0.0)
        share = np.min(np.where(np.abs(yaw) > 1e-9, room / np.maximum(np.abs(yaw), 1e-9), 1.0), -1, keepdims=True)
        thrusts: Array = np.clip(without + yaw * np.clip(share, 0.0, 1.0), 0.02 * self._largest, self._largest)
        return thrusts
