"""ArduPilot Copter: parameters for hover, thrust curve and the drag of its wind estimation (EKF3)."""

from quadctl.export.autopilot import Dialect, Older

ROTORS_OF_CLASS = {1: 4, 2: 6, 3: 8, 4: 8, 5: 6, 7: 3}
"""Number of rotors by FRAME_CLASS: quad, hexa, octa, octa-quad, Y6, tri."""

ARDUPILOT = Dialect(
    name="ArduPilot",
    hover="MOT_THST_HOVER",
    curve="MOT_THST_EXPO",
    ballistic_x="EK3_DRAG_BCOEF_X",
    ballistic_y="EK3_DRAG_BCOEF_Y",
    momentum_drag="EK3_DRAG_MCOEF",
    switches={},  # coefficients above 0 switch it on
    default_curve=0.65,
    ranges={
        "MOT_THST_HOVER": (0.125, 0.6875),
        "MOT_THST_EXPO": (-1.0, 1.0),
        "EK3_DRAG_BCOEF_X": (0.0, 1000.0),
        "EK3_DRAG_BCOEF_Y": (0.0, 1000.0),
        "EK3_DRAG_MCOEF": (0.0, 1.0),
    },
    older={
        "MOT_THST_HOVER": Older(
            "THR_MID",
            lambda _, hover: float(round(1000.0 * hover)),
            "up to Copter 3.3 THR_MID, in thousandths, is the throttle of hover",
        )
    },
    since=dict.fromkeys(("EK3_DRAG_BCOEF_X", "EK3_DRAG_BCOEF_Y", "EK3_DRAG_MCOEF"), "4.1"),
    notes={
        "MOT_THST_HOVER": "the initial value: MOT_HOVER_LEARN 2 then updates it in flight",
        "MOT_THST_EXPO": "tune the gains of the rate controller again; the vehicle file's throttle line changes, too",
        "EK3_DRAG_MCOEF": "one number for both axes",
    },
    frame="FRAME_CLASS",
    n_rotors=lambda value: ROTORS_OF_CLASS.get(int(value)),
    file_line=lambda name, value: f"{name},{value:.9g}",
)
