"""Words of the facts about poses."""

import pytest

from quadctl.mocap.findings import Kind
from quadctl.words import fact

TILTED = "the rigid body is tilted 90 deg away from the autopilot's attitude (--frame nwu): "
WORDS = {
    f"{TILTED}with --frame y_up they agree": fact(Kind.TILTED, off_deg=90.2, frame="nwu", best="y_up"),
    f"{TILTED}define the rigid body anew on the level vehicle": fact(Kind.TILTED, off_deg=90.2, frame="nwu", best=None),
    "the rigid body's heading is +45 deg from the autopilot's: turn its x axis forward, or say --yaw 45, unless the "
    "autopilot has no compass and takes its heading from here": fact(Kind.HEADING_OFF, off_deg=45.1),
    "the vehicle moves north by motion capture and west by the autopilot: check --frame and --yaw": fact(
        Kind.MOVES_OTHERWISE, by_poses=(0, False), by_autopilot=(1, True)
    ),
}


@pytest.mark.parametrize("words", WORDS)
def test_a_fact_about_poses_is_worded_by_its_template(words: str) -> None:
    assert str(WORDS[words]) == words
