"""PX4: parameters for hover, thrust curve and the drag of its wind estimation (EKF2, drag_fusion)."""

from quadctl.export.autopilot import Dialect

REAL32, INT32 = 9, 6
"""MAV_PARAM_TYPE in QGroundControl's parameter files."""

PX4 = Dialect(
    name="PX4",
    hover="MPC_THR_HOVER",
    curve="THR_MDL_FAC",
    ballistic_x="EKF2_BCOEF_X",
    ballistic_y="EKF2_BCOEF_Y",
    momentum_drag="EKF2_MCOEF",
    switches={"EKF2_DRAG_CTRL": 1.0},
    default_curve=0.0,
    notes={
        "MPC_THR_HOVER": "where it starts from; MPC_USE_HTE then tracks it in flight",
        "THR_MDL_FAC": "tune the gains of the rate controller again; the vehicle file's throttle line changes, too",
        "EKF2_MCOEF": "one number for both axes",
        "EKF2_DRAG_CTRL": "without it the drag is not used",
    },
    frame="CA_ROTOR_COUNT",
    n_rotors=lambda value: int(value) or None,
    file_line=lambda name, value: f"1\t1\t{name}\t{value:.9g}\t{INT32 if name == 'EKF2_DRAG_CTRL' else REAL32}",
)
