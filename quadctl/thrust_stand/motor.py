"""One motor of a disarmed vehicle, run by MAVLink's motor test, which ends by itself when it is not renewed."""

import math
from collections.abc import Iterable

from quadctl.errors import FlightError
from quadctl.flight.autopilot import mavlink
from quadctl.flight.autopilot.mavsdk_autopilot import MavsdkAutopilot
from quadctl.vehicle import Vehicle

THROTTLE_PERCENT = 0.0
"""MOTOR_TEST_THROTTLE_PERCENT: of the motor's output, in whole percent on ArduPilot."""
ALIVE_S = 1.0
"""The autopilot stops a motor that nobody has renewed for so long: a hung or killed program, a lost link."""
RENEW_S = 0.25


class StandMotor(MavsdkAutopilot):
    """Rotor `number`, from 1, of the vehicle at the other end of `url`."""

    def __init__(self, url: str, vehicle: Vehicle, number: int, connect_timeout_s: float = 10.0) -> None:
        """Raises LinkError when `url` is not one that MAVSDK can open."""
        super().__init__(url, vehicle.n_rotors, connect_timeout_s)
        self.number = number
        self._place = clockwise_place(vehicle, number)

    async def prepare(self) -> None:
        """Connect, and ask for rotor speeds, currents and voltage.

        Raises
        ------
        LinkError
            No autopilot answers.
        FlightError
            The vehicle is armed, or its motor outputs are not on the scale of its throttle.
        """
        await self.connect()
        await self.request_telemetry()
        if self.state().armed:
            raise FlightError(f"{self.description} is armed, expected a disarmed vehicle: a motor test needs it so.")
        name = self.firmware.throttle_bent_by
        bent = (await self.parameters([name])).get(name, 0.0) if name else 0.0
        if bent != 0.0:
            raise FlightError(
                f"{self.description} has {name} = {bent:g}, expected 0: a motor test goes past that curve, so the "
                "throttle measured here would not be the one that flies."
            )

    def throttle(self, percent: int) -> float:
        """The throttle target that gives each motor the output of the test, 0..1."""
        return self._telemetry.throttle_of(1000.0 + 10.0 * percent)

    def on_scale(self, percents: Iterable[int]) -> list[int]:
        """These outputs, rising, brought into the range that flights use: ArduPilot's ends at MOT_SPIN_MAX."""
        lowest = max(p for p in range(100) if self.throttle(p) <= self.throttle(0))
        highest = min(p for p in range(1, 101) if self.throttle(p) >= self.throttle(100))
        return sorted({min(max(percent, lowest), highest) for percent in percents})

    async def spin(self, percent: int) -> None:
        """Run it; returns when the autopilot has accepted. To be renewed within ALIVE_S.

        Raises
        ------
        FlightError
            The autopilot refuses, with its reasons.
        LinkError
            No answer comes.
        """
        await self._request(f"run motor {self.number} at {percent} %", mavlink.CMD_DO_MOTOR_TEST, *self._test(percent))

    def renew(self, percent: int) -> None:
        """Go on for another ALIVE_S. One message, without acknowledgement: none is repeated behind our back."""
        self._send_test(self._test(percent))

    def stop(self) -> None:
        """Stop it, at once; callable from anywhere."""
        self._send_test((self._test_number, THROTTLE_PERCENT, 0.0, 0.0))

    @property
    def _test_number(self) -> float:
        return self._place if self.firmware.tests_motors_clockwise else self.number

    def _test(self, percent: int) -> tuple[float, ...]:
        return self._test_number, THROTTLE_PERCENT, percent, ALIVE_S

    def _send_test(self, parameters: tuple[float, ...]) -> None:
        padded = (*parameters, 0.0, 0.0, 0.0, 0.0)[:7]
        fields = {
            "target_system": self._link.system_id,
            "target_component": mavlink.MAV_COMP_ID_AUTOPILOT,
            "command": mavlink.CMD_DO_MOTOR_TEST,
            "confirmation": 0,
            **{f"param{i}": float(value) for i, value in enumerate(padded, start=1)},
        }
        self._link.send("COMMAND_LONG", fields)


def clockwise_place(vehicle: Vehicle, number: int) -> int:
    """ArduPilot's number of a rotor in a motor test: from 1, clockwise seen from above, from the front."""

    def azimuth(rotor: int) -> float:
        x, y, _ = vehicle.rotors[rotor].position_m
        return round(math.atan2(y, x) % (2.0 * math.pi), 6)

    return sorted(range(vehicle.n_rotors), key=azimuth).index(number - 1) + 1
