"""A weak motor as ArduPilot's simulator makes one: by its pulse, not by its thrust.

That the measured flights were weakened in this way is inferred: at 80 % it explains their lean, the thrust half of it.
"""

from quadctl.thrust_chain.ardupilot import DEFAULT_CURVE, output_of_thrust, thrust_of_output
from quadctl.thrust_chain.chain import Ambient

HOVER = 0.364
"""MOT_THST_HOVER of the vehicle whose motors were weakened."""


def loss_of_pulse(share: float) -> float:
    """Share of the hover thrust that a motor loses whose pulse is `share` of the one sent (SIM_ENGINE_MUL).

    Source: `SITL_State::_simulator_servos` scales the pulse above 1000 us; the curve of the motors does the rest: half
    of the pulse leaves a fifth of the thrust.
    """
    pulse = output_of_thrust(HOVER, DEFAULT_CURVE, Ambient())
    return 1.0 - float(thrust_of_output(share * pulse, DEFAULT_CURVE, Ambient())) / HOVER
