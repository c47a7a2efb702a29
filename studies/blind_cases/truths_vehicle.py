"""Hidden truths of the vehicle: mass, rotors, motors, battery, cable, accelerometer."""

import math
import random

from quadctl.frames import rotate
from quadctl.sitl.vehicle.body import Battery
from quadctl.state import Quat, Vec3
from quadctl.vehicle import Vehicle

from .world import HiddenBody, Instant, Truth


class OtherMass(Truth):
    """The vehicle weighs 8 % more or less than its file says: another battery, a camera."""

    family = "thrust_scale"

    def __init__(self, vehicle: Vehicle, strength: float, chance: random.Random) -> None:
        super().__init__(vehicle, strength, chance)
        self.share = 0.08 * strength * chance.choice((-1.0, 1.0))

    def mass_kg(self, time_s: float) -> float:
        return self.share * self.vehicle.mass_kg

    def parameters(self) -> dict[str, dict[str, float]]:
        return {"thrust_scale.constant": {"factor": 1.0 / (1.0 + self.share)}}


class Cargo(Truth):
    """10 % of the mass is picked up or dropped half-way through the flight: a parcel, a sample, a sprayer's charge."""

    family = "payload"

    def __init__(self, vehicle: Vehicle, strength: float, chance: random.Random) -> None:
        super().__init__(vehicle, strength, chance)
        self.change_kg = 0.1 * strength * vehicle.mass_kg * chance.choice((-1.0, 1.0))
        self.at_s = chance.uniform(35.0, 50.0)

    def mass_kg(self, time_s: float) -> float:
        return self.change_kg if time_s >= self.at_s else 0.0

    def parameters(self) -> dict[str, dict[str, float]]:
        return {"payload.step": {"mass_kg": self.change_kg}}


class TiredBattery(Truth):
    """A worn pack whose voltage falls by 1.5 V in a flight of 70 s; rotor speed at a given output follows voltage^0.8.

    Thrust falls as voltage^1.6 (between 1 for a loaded motor and 2 for a free one, as both PX4 and ArduPilot assume in
    their battery compensation), 10 to 15 % over the flight. The log holds motor outputs.
    """

    family = "battery_sag"

    def enter(self, body: HiddenBody) -> None:
        body.from_outputs = True
        body.voltage_exponent = 0.8 * self.strength
        size = self.vehicle.weight_n / 14.7
        body.battery = WornBattery(charge_c=2200.0 * size, resistance_ohm=0.03 / size)


class WornBattery(Battery):
    """A pack that holds little charge any more."""

    def __init__(self, charge_c: float, resistance_ohm: float) -> None:
        super().__init__()
        self.CHARGE_C = charge_c
        self.RESISTANCE_OHM = resistance_ohm


class SluggishMotors(Truth):
    """Rotors take 50 ms more to speed up and 70 ms more to slow down than the file says, for nobody brakes them.

    Large propellers on slow controllers have some 100 ms in all (Pounds et al. 2007). The log holds motor outputs.
    """

    family = "motor_lag"

    def enter(self, body: HiddenBody) -> None:
        body.from_outputs = True
        lag = self.vehicle.rotor.time_constant_s
        body.lag_s = (lag + 0.05 * self.strength, lag + 0.07 * self.strength)


class BentArms(Truth):
    """The rotors lean 2 degrees to one side, each by its own amount: arms bent in a crash, motors mounted askew."""

    family = "thrust_tilt"

    def __init__(self, vehicle: Vehicle, strength: float, chance: random.Random) -> None:
        super().__init__(vehicle, strength, chance)
        toward = chance.uniform(0.0, 2.0 * math.pi)
        own = [(chance.gauss(0.0, 0.4), chance.gauss(0.0, 0.4)) for _ in vehicle.rotors]
        mean = [sum(o[axis] for o in own) / len(own) for axis in (0, 1)]
        lean = 2.0 * strength
        self.leans = [
            (
                math.radians(lean * math.cos(toward) + strength * (o[0] - mean[0])),
                math.radians(lean * math.sin(toward) + strength * (o[1] - mean[1])),
            )
            for o in own
        ]
        """Tilt of each rotor about body x and y, radians."""
        self.toward = toward

    def enter(self, body: HiddenBody) -> None:
        body.axes = [_leaning(axis, *lean) for axis, lean in zip(body.axes, self.leans, strict=True)]

    def parameters(self) -> dict[str, dict[str, float]]:
        lean = 2.0 * self.strength
        roll, pitch = lean * math.cos(self.toward), lean * math.sin(self.toward)
        return {"thrust_tilt.fixed": {"roll_deg": roll, "pitch_deg": pitch}}


class Cable(Truth):
    """A power cable of 50 g/m (per 1.5 kg of vehicle) from a reel: a catenary that leaves the ground flat.

    Its lifted length is sqrt(h^2 + 2 h a), a = H / w, with a horizontal pull H of 0.03 N toward the reel, 2 m north.
    """

    family = "tether"
    REEL: Vec3 = (2.0, 0.0, 0.0)

    def act(self, now: Instant) -> None:
        weight = self.strength * 0.5 * self.vehicle.mass_kg / 1.5
        pull = self.strength * 0.03
        height = max(-now.position[2], 0.0)
        north, east = self.REEL[0] - now.position[0], self.REEL[1] - now.position[1]
        away = max(math.hypot(north, east), 0.3)
        lifted = math.sqrt(height * height + 2.0 * height * 0.06)
        now.push_ned(pull * north / away, pull * east / away, weight * lifted)


class ChippedBlade(Truth):
    """One rotor lost a piece of a blade: 15 % less thrust and 10 % less drag torque, with a once-per-turn shake.

    Brown et al. and fault data sets of small multirotors (Puchalski & Giernacki 2022) cut 5 to 30 % of a blade.
    """

    family = "rotor_fault"

    def __init__(self, vehicle: Vehicle, strength: float, chance: random.Random) -> None:
        super().__init__(vehicle, strength, chance)
        self.rotor = chance.randrange(vehicle.n_rotors)
        self.shake = random.Random(chance.random())

    def act(self, now: Instant) -> None:
        i = self.rotor
        lost = 0.15 * self.strength * now.thrusts[i]
        # The drag torque falls less than the thrust: give back a third of what the file's ratio takes away.
        now.turn(0.0, 0.0, 0.33 * self.vehicle.moment_arms_m[i][2] * lost)
        now.thrusts[i] -= lost
        size = 0.02 * self.hover_n * self.strength
        now.push(self.shake.gauss(0.0, size), self.shake.gauss(0.0, size), 0.0)

    def parameters(self) -> dict[str, dict[str, float]]:
        return {"rotor_fault.weak": {"loss": 0.15 * self.strength, "rotor": self.rotor + 1.0}}


class ShiftedAccelerometer(Truth):
    """The accelerometer's zero moved by 35 mg: data sheets of the usual sensors allow 60 mg before calibration."""

    family = "imu_bias"

    def __init__(self, vehicle: Vehicle, strength: float, chance: random.Random) -> None:
        super().__init__(vehicle, strength, chance)
        direction = [chance.gauss(0.0, 1.0) for _ in range(3)]
        length = math.hypot(*direction)
        size = 0.35 * strength
        self.bias: Vec3 = (
            size * direction[0] / length,
            size * direction[1] / length,
            size * direction[2] / length,
        )


class ReynoldsThrust(Truth):
    """The thrust coefficient grows with the Reynolds number: C_T = C_inf (1 - 0.2 rpm_hover / rpm).

    Deters, Ananda & Selig 2014 find C_T of small propellers 10 to 20 % larger at twice the speed.
    """

    family = "thrust_curve"

    def act(self, now: Instant) -> None:
        share = 0.2 * self.strength
        for i, rpm in enumerate(now.rpm):
            now.thrusts[i] *= max(1.0 - share * self.hover_rpm / max(rpm, 500.0), 0.2) / (1.0 - share)


def _leaning(axis: Vec3, roll: float, pitch: float) -> Vec3:
    half: Quat = (math.sqrt(1.0 - 0.25 * (roll * roll + pitch * pitch)), 0.5 * roll, 0.5 * pitch, 0.0)
    return rotate(half, axis)
