"""The simulated world of the demo and of the page's sample flight: what it hides, nothing but the simulator reads."""

HIDDEN = {
    "effects": [{"effect": "hidden.ground_cushion", "parameters": {"gain": 0.25, "width": 1.8}}],
    "noise": {"position_m": 0.0005, "velocity_m_s": 0.01, "attitude_deg": 0.1, "rpm": 20},
}
