"""PX4's events about arming become reasons in words: those that it sent in a recorded boot."""

from quadctl.flight.autopilot.px4_events import ArmingReport

BOOT = (  # events of forward_runs.ulg at 2.084 s: number, log levels, arguments
    (0x01A893E0, 0x88, "008000130100000000802a0180802a01800000000000000000"),
    (0x01FDF2ED, 0x33, "7ed17e0011"),
    (0x019F748F, 0x22, "7ed17e0010"),
    (0x01D31BB9, 0x33, "7c007e0011"),
    (0x0198C273, 0x33, "3800000018"),
    (0x0105C2D9, 0x66, "0800000014"),
    (0x012F1DC7, 0x33, "0040000014"),
    (0x0106ED29, 0x33, "4785000007"),
    (0x0167C97B, 0x66, "ffffffff0c"),
    (0x011D3727, 0x88, "00020c0238"),
)
READY = (  # and at 6.176 s
    (0x01A893E0, 0x88, "008000100000000000b03a7f80b03a7f80"),
    (0x0105C2D9, 0x66, "0800000014"),
    (0x012F1DC7, 0x33, "0040000014"),
    (0x0106ED29, 0x33, "4785000007"),
)


def taken(report: ArmingReport, events: tuple[tuple[int, int, str], ...]) -> ArmingReport:
    for number, levels, data in events:
        arguments = list(bytes.fromhex(data.ljust(80, "0")))
        report.take({"id": number, "log_levels": levels, "arguments": arguments})
    return report


def test_the_reasons_of_a_recorded_boot_are_told_by_the_mode_that_they_bar() -> None:
    report = taken(ArmingReport(), BOOT)
    assert report.against("HOLD") == (
        "Heading estimate not stable",
        "No valid attitude estimate",
        "Navigation error: No valid position estimate",
        "Navigation error: No valid global position estimate",
    )
    assert report.against("OFFBOARD") == ("Heading estimate not stable", "No valid attitude estimate")
    assert "No manual control input" in report.against("POSCTL")


def test_the_next_report_takes_the_place_of_the_last() -> None:
    report = taken(taken(ArmingReport(), BOOT), READY)
    assert report.against("HOLD", "OFFBOARD") == ()  # missing setpoints and a missing mission are none


def test_an_instance_is_named_and_events_of_other_parts_are_left_alone() -> None:
    report = ArmingReport()
    uncalibrated = 16716537
    taken(report, ((1 << 24 | uncalibrated, 0x33, "ffffffff0002"), (2 << 24 | uncalibrated, 0x33, "ffffffff0003")))
    assert report.against("HOLD") == ("Compass 2 uncalibrated",)
