"""One exception hierarchy. Each message is one sentence that a user can act on; the CLI prints it and exits with 1."""


class QuadctlError(Exception):
    """Something the user can mend: the message says what, where, and what was expected."""


class SettingsError(QuadctlError):
    """A YAML file (vehicle, model, mission, configuration) cannot be used as it stands."""


class LogError(QuadctlError):
    """A flight log cannot be read or cannot be analysed."""


class FlightError(QuadctlError):
    """A flight could not begin or had to end early."""


class RefusalError(FlightError):
    """The autopilot answered a request with a refusal, and did nothing."""


class LinkError(FlightError):
    """The autopilot does not answer."""
