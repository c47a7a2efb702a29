"""One flight from its files to its outcome: read and check everything before anything moves, then fly, then report."""

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, NamedTuple

from rich.console import Console

from quadctl.compensator import Compensator, check_compensator
from quadctl.errors import FlightError
from quadctl.flight.autopilot import Autopilot
from quadctl.flight.display import Display
from quadctl.flight.loop import fly, landing_on_signals
from quadctl.flight.mavsdk_autopilot import MavsdkAutopilot
from quadctl.flight.outcome import Outcome, Tally
from quadctl.flight.pilot import Pilot
from quadctl.flight.realtime import privileges, run
from quadctl.flight.recorder import Recorder
from quadctl.flight.requirements import requirements_met
from quadctl.flight.settings import FlightSettings, choose_models, find_config, load_flight_settings
from quadctl.flight.view_link import ViewEnd, ViewLink
from quadctl.missions import Mission, load_mission
from quadctl.model import Model


class FlightPlan(NamedTuple):
    """Everything that a flight is made of."""

    mission: Mission
    settings: FlightSettings
    body: Model
    compensator: Model
    warnings: Sequence[str]

    @property
    def rotor_heights_m(self) -> tuple[float, float]:
        """Lowest and highest height of the rotor plane that the mission's limits allow."""
        up = self.body.vehicle.rotor_height_m
        return max(self.mission.limits.min_z_m + up, 0.01), self.mission.limits.max_z_m + up

    def pilot(self, autopilot_takes_off: bool = False) -> Pilot:
        compensator = Compensator(self.compensator, self.settings.compensator_limits)
        return Pilot(self.mission, self.body, self.settings, compensator, autopilot_takes_off)

    def recorder(self, log_dir: Path, autopilot: str, real_time: Sequence[str] = ()) -> Recorder:
        """`real_time`: what keeps the ticks of a flight in real time punctual."""
        vehicle = self.body.vehicle
        meta: dict[str, Any] = {
            "mission": self.mission.name,
            "offset_up_m": self.mission.offset_up_m,
            "parameters": dict(self.mission.parameters),
            "autopilot": autopilot,
            "compensator": self.compensator.name,
            "model": [{"effect": e.name, "parameters": e.values()} for e in self.compensator.effects],
            "vehicle": vehicle.model_dump(mode="json", exclude_none=True),
            "controller": self.settings.controller.model_dump(mode="json"),
            "guards": self.settings.guards.model_dump(mode="json"),
            "real_time": list(real_time),
        }
        return Recorder(log_dir, self.mission.name, vehicle.n_rotors, meta)


def read_flight(
    mission: Path,
    config: Path | None,
    model: str | None,
    offset_up_m: float | None,
    overrides: Sequence[str] = (),
    vehicle: Path | None = None,
) -> FlightPlan:
    """Read mission (with `overrides` of its parameters), configuration and model; `vehicle` goes before the
    configuration's.

    Raises
    ------
    SettingsError
        One sentence that names the file, the field, the value and what was expected.
    """
    loaded = load_mission(mission, offset_up_m, overrides)
    config_path = find_config(config, mission)
    settings = load_flight_settings(config_path)
    if vehicle is not None:
        settings = settings.model_copy(update={"vehicle": str(vehicle.absolute())})
    models = choose_models(settings, config_path, model)
    return FlightPlan(loaded, settings, models.body, models.compensator, ())


def prepare_flight(
    mission: Path, config: Path | None, model: str | None, offset_up_m: float | None, overrides: Sequence[str] = ()
) -> FlightPlan:
    """Read a flight as `read_flight` does, and refuse a compensator that must not fly.

    Raises
    ------
    SettingsError
        One sentence that names the file, the field, the value and what was expected.
    """
    plan = read_flight(mission, config, model, offset_up_m, overrides)
    return plan._replace(warnings=check_compensator(plan.compensator, *plan.rotor_heights_m, plan.compensator.name))


def fly_real_time(
    plan: FlightPlan,
    url: str,
    log_dir: Path,
    console: Console,
    set_parameters: bool = False,
    view: ViewEnd | None = None,
) -> Outcome:
    """Fly on the autopilot at `url`, with a display on `console`, and a viewer at the other end of `view`; with
    `set_parameters`, set what it must have and restore it afterwards.

    Raises
    ------
    LinkError
        No autopilot answers at `url`.
    FlightError
        The log cannot be written, the autopilot refuses what a flight needs, or Ctrl-C came before the flight.
    """
    autopilot = MavsdkAutopilot(url, plan.body.vehicle.n_rotors, plan.settings.link.timeout_s)
    try:
        with privileges() as real_time:
            return run(_fly(plan, autopilot, log_dir, console, set_parameters, view, real_time))
    except KeyboardInterrupt:  # in flight, Ctrl-C is a wish to land
        raise FlightError("interrupted while the link was being opened or closed") from None


async def _fly(
    plan: FlightPlan,
    autopilot: Autopilot,
    log_dir: Path,
    console: Console,
    set_parameters: bool,
    view: ViewEnd | None,
    real_time: Sequence[str],
) -> Outcome:
    def warn(sentence: str) -> None:
        console.print(f"warning: {sentence}", style="yellow", soft_wrap=True, markup=False, highlight=False)

    try:
        with console.status("waiting for the autopilot"):
            await autopilot.connect()
            await autopilot.request_telemetry()
        for warning in autopilot.warnings:
            warn(warning)
        async with requirements_met(autopilot, set_parameters, warn):
            return await _fly_prepared(plan, autopilot, log_dir, console, view, real_time)
    finally:
        await autopilot.close()


async def _fly_prepared(
    plan: FlightPlan,
    autopilot: Autopilot,
    log_dir: Path,
    console: Console,
    view: ViewEnd | None,
    real_time: Sequence[str],
) -> Outcome:
    rate_hz = plan.settings.controller.rate_hz
    pilot = plan.pilot(autopilot.takes_off_itself)
    recorder = plan.recorder(log_dir, autopilot.description, real_time)
    tally = Tally(1.0 / rate_hz)
    with ExitStack() as stack:
        stack.callback(lambda: recorder.close(pilot.ended or "broken off"))
        stack.enter_context(landing_on_signals(pilot))
        display = stack.enter_context(Display(pilot, console, real_time))
        viewer = [] if view is None else [ViewLink(view, pilot)]
        await fly(autopilot, pilot, rate_hz, [recorder, tally, display, *viewer])
    return tally.outcome(pilot, recorder.path, recorder.problem)
