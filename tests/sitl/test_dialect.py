"""Messages that pymavlink's dialect lacks."""

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from quadctl.sitl.server import dialect


def test_esc_status_survives_the_wire_of_pymavlink() -> None:
    dialect.register(mavlink)
    sent = dialect.EscStatus(4, 123456, [1, -2, 3, 40000], [16.5, 0.0, 1.0, 2.0], [0.5, 1.5, 2.5, 3.5])
    data = sent.pack(mavlink.MAVLink(None, srcSystem=1, srcComponent=1))
    (received,) = mavlink.MAVLink(None).parse_buffer(data)
    assert received.get_type() == "ESC_STATUS"
    assert (received.index, received.time_usec) == (4, 123456)
    assert received.rpm == [1, -2, 3, 40000]
    assert received.voltage == [16.5, 0.0, 1.0, 2.0]
    assert received.current == [0.5, 1.5, 2.5, 3.5]


def test_an_event_survives_the_wire_of_pymavlink() -> None:
    dialect.register(mavlink)
    sent = dialect.Event(0, 0, 1 << 24 | 77, 1234, 5, 0x33, list(range(40)))
    (received,) = mavlink.MAVLink(None).parse_buffer(sent.pack(mavlink.MAVLink(None, srcSystem=1, srcComponent=1)))
    assert received.get_type() == "EVENT"
    assert (received.id, received.sequence, received.log_levels) == (1 << 24 | 77, 5, 0x33)
    assert list(received.arguments) == list(range(40))


def test_current_mode_survives_the_wire_of_pymavlink() -> None:
    dialect.register(mavlink)
    data = dialect.CurrentMode(3, 6 << 16, 4 << 16 | 6 << 24).pack(mavlink.MAVLink(None, srcSystem=1, srcComponent=1))
    (received,) = mavlink.MAVLink(None).parse_buffer(data)
    assert received.get_type() == "CURRENT_MODE"
    assert (received.standard_mode, received.custom_mode) == (3, 6 << 16)
    assert received.intended_custom_mode == 4 << 16 | 6 << 24
