"""PX4: parameters for hover, thrust curve and the drag of its wind estimation (EKF2, drag_fusion)."""

from quadctl.export.autopilot import Dialect, Older

REAL32, INT32 = 9, 6
"""MAV_PARAM_TYPE in QGroundControl's parameter files."""
INTEGERS = ("EKF2_DRAG_CTRL", "EKF2_AID_MASK")
AID_DRAG = 1 << 5
"""Bit of EKF2_AID_MASK."""

PX4 = Dialect(
    name="PX4",
    hover="MPC_THR_HOVER",
    curve="THR_MDL_FAC",
    ballistic_x="EKF2_BCOEF_X",
    ballistic_y="EKF2_BCOEF_Y",
    momentum_drag="EKF2_MCOEF",
    switches={"EKF2_DRAG_CTRL": 1.0},
    default_curve=0.0,
    ranges={
        "MPC_THR_HOVER": (0.1, 0.8),
        "THR_MDL_FAC": (0.0, 1.0),
        "EKF2_BCOEF_X": (0.0, 200.0),
        "EKF2_BCOEF_Y": (0.0, 200.0),
        "EKF2_MCOEF": (0.0, 1.0),
    },
    older={
        "EKF2_DRAG_CTRL": Older(
            "EKF2_AID_MASK",
            lambda present, _: float(int(present) | AID_DRAG),
            "up to PX4 1.13 the drag is switched on by bit 5 (value 32) of EKF2_AID_MASK",
        )
    },
    since={},
    notes={
        "MPC_THR_HOVER": "only a start value where MPC_USE_HTE is 1",
        "THR_MDL_FAC": "tune the gains of the rate controller again; the vehicle file's throttle line changes, too",
        "EKF2_MCOEF": "one number for both axes",
        "EKF2_DRAG_CTRL": "1 switches the drag on",
        "EKF2_AID_MASK": "without bit 5 the drag is not used",
    },
    frame="CA_ROTOR_COUNT",
    n_rotors=lambda value: int(value) or None,
    file_line=lambda name, value: f"1\t1\t{name}\t{value:.9g}\t{INT32 if name in INTEGERS else REAL32}",
)
