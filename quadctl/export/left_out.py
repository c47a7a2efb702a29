"""Parts of a model that a target cannot hold: kinds of reasons, each with the template of its words."""

from enum import unique

from quadctl.words import Kinds


@unique
class Kind(Kinds):
    NO_PARAMETER = "{effect}: {target} has no parameter for it"
    # --- between command and thrust ---
    DELAY = (
        "delay of the command: {delay_s:.3f} s [{low_s:.3f}, {high_s:.3f}] in the flights of the fit: give the command "
        "of so long ago"
    )
    OTHER_DELAY = "{effect}: a delay of another kind than a first-order lag"
    TWO_LAGS = "{effect}: two lags in a row, {target}"
    THROTTLE_LINE = "throttle line ({offset:g} + {per_newton:g} T): {target} is commanded by rotor speeds"
    OF_COMMAND = "{effect}: it makes a thrust of the command: {target} is commanded by rotor speeds"
    THROTTLE_OFFSET = "throttle offset {offset:g}: SIH's thrust is proportional to the output"
    MOTOR_LAG = "motor lag: SITL has a limit of the slope (slew_max) instead"
    EACH_ROTOR = "battery, voltage sag and position of each rotor: SITL's own"
    OBSERVER = "observer of slow forces and moments: {target} has no such states; --to numpy holds it"
    # --- what the equations hold for no flight, or not at all ---
    SENSED = "{effect}: an error of the accelerometer, which moves nothing"
    LATER_FLIGHT = "{effect}: it begins in flight {flight:g}, and these equations are of no flight"
    OF_FLIGHTS = "{effect}: its values of flight {flights:list}: those of all other flights are taken"
    THRUST_RATE = "{effect}: in x_dot, whose thrust does not change; x_dot_commanded holds it"
    NO_LAG = "{effect}: without a rotor lag in the vehicle file the thrust has no rate of change"
    # --- forces of another form ---
    OTHER_FORM = "{effect}: {model} in the model, {target}; {equal} in hover"
    DIFFERENCE = "{effect}: {values} differ: {mean}"
    DIFFERENCE_OF_AXES = "{effect}: its axes differ ({values}): the mean of x and y is taken along all"
    ALONG_AXES = "{effect}: d_z {d_z:g}: Gazebo's rotors have no drag along their axes"
    SATURATION = (
        "{effect}: its saturation above {speed_m_s:.3g} m/s: RotorPy's lift grows with the square of the speed without "
        "end"
    )
    GRAVITY = "gravity: RotorPy's is {theirs}, the model's {ours}: {more:.4f} m/s^2 more downward"
