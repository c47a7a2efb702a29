"""The workbench: the actions on flights, sessions and files, without any user interface; all tabs show the same one."""

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from quadctl.errors import QuadctlError, SettingsError
from quadctl.lab.comparison.wording import listed
from quadctl.lab.flights.dataset import HoldOut
from quadctl.lab.report.results import Shown
from quadctl.model import Model, load_model, model_to_dict
from quadctl.vehicle import Vehicle
from quadctl.web.session.earlier import free_name
from quadctl.web.session.files import changed_logs
from quadctl.web.session.history import History
from quadctl.web.session.session import Session, load_session
from quadctl.web.work import jobs
from quadctl.web.work.reading import without_folder
from quadctl.web.workbench.analysis import Analysis


@dataclass(repr=False)
class Workbench(Analysis):
    """An analysis whose flights and vehicle can be changed, and that can be saved, flown in simulation and reported."""

    other_model: Model | None = None
    """Model of a file, to be drawn beside those of the session; nothing is fitted to it, nor judged by it."""
    _before: Session | None = field(default=None, init=False)
    """Session that the present one took the place of."""

    # --- flights and model --------------------------------------------------------------------------------------------

    async def open_logs(self, paths: Sequence[Path]) -> None:
        await self._with_flights(self.session.with_logs(paths), known=True)

    async def open_sample(self) -> None:
        """Fly the vehicle in a simulated world with a hidden effect, and open the log."""
        vehicle = self.session.vehicle
        if vehicle is None:
            self.say("error", "There is no vehicle yet: choose the one to fly.")
            return
        flown = None
        async with self._working("Flying a sample flight in simulation") as progress:
            flown = await self._quick.run(self.simulation.fly_sample, vehicle, progress=progress)
        if flown is not None:
            await self.open_logs([flown])

    async def forget_log(self, path: Path) -> None:
        await self._with_flights(self.session.without_log(path), known=True)
        if path not in self.session.logs:
            self.accepted -= {path}  # whoever opens it again is asked again

    async def hold_out_log(self, path: Path, unseen: bool) -> None:
        try:
            changed = self.session.with_role(path, unseen)
        except SettingsError as error:
            self.say("error", str(error))
            return
        await self._with_flights(changed)

    async def hold_out_by(self, hold_out: HoldOut) -> None:
        await self._with_flights(replace(self.session, hold_out=hold_out).unjudged())

    async def begin_with(self, path: Path) -> None:
        """Begin a new model sequence with the model or vehicle in a file."""
        try:
            model = load_model(path)
        except QuadctlError as error:
            self.say("error", without_folder(str(error), path))
            return
        before, history = self.session, self.history.after(self.session)  # of the same flights
        await self._with_flights(before.unjudged().begun_with(model))
        if self.session is before or before.model is None:
            return
        self.history = history
        self._changed()
        if before.model.effects and self.message is None:
            gone = listed([effect.name for effect in before.model.effects])
            self.say("done", f"The model is now {model.name}; {gone} went with the one before.", undo=True)

    def show_beside(self, model: Model) -> None:
        """Show a model beside those of the session.

        Raises
        ------
        SettingsError
            It is of a vehicle with another number of rotors.
        """
        vehicle = self.session.vehicle
        if vehicle is not None and model.vehicle.n_rotors != vehicle.n_rotors:
            raise SettingsError(
                f"{model.name}: has {model.vehicle.n_rotors} rotors, expected {vehicle.n_rotors} as {vehicle.name} has"
            )
        self.other_model = model
        self._changed()

    def confirm_vehicle(self) -> None:
        """Take the vehicle that was assumed as the one that flew."""
        self.session = replace(self.session, vehicle_assumed=False)
        self._autosave()
        self._changed()

    async def use_anyway(self, path: Path) -> None:
        """Use a log in spite of the doubt about it."""
        self.accepted |= {path}
        await self._with_flights(self.session, known=True)

    async def start_anew(self) -> None:
        """Begin a new session with the vehicle of this one, which is kept in a file."""
        vehicle = self.session.vehicle
        kept = free_name(self.folder)
        if not self._save(kept):
            return
        before = self.session
        begun = Session() if vehicle is None else Session().begun_with(Model(vehicle, name=vehicle.name))
        await self._with_flights(replace(begun, vehicle_assumed=True))
        if self.message is not None:
            return
        self.history, self.other_model = History(), None
        self._before = before
        self._autosave()
        kept_as = f"The session before is kept as {self.folder / kept}: open that file to go on with it."
        self.say("done", kept_as, go_back=True)

    async def go_back(self) -> None:
        """Go on with the session before the present one."""
        if self._before is not None:
            await self.resume(self._before)

    async def open_earlier(self, path: Path) -> None:
        """Go on with a session that is kept in the folder of the page."""
        try:
            session = await asyncio.to_thread(load_session, path)
        except QuadctlError as error:
            self.say("error", f"{error}.")
            return
        await self.resume(session)

    async def resume(self, session: Session) -> None:
        if any(step.error_m_s2 is not None for step in session.sequence):  # its logs were in use when it was saved
            self.accepted |= set(session.logs)
        changed = await asyncio.to_thread(changed_logs, session.hashes)
        for log in changed:
            session = session.without_log(log).unjudged()
        before, kept = self.session, free_name(self.folder)
        if before.logs and not self._save(kept):
            return
        await self._with_flights(session)
        if self.session is not before:  # what was changed in another session cannot be taken back in this one
            self.history = History()
            self._autosave()
            if before.logs:
                self._before = before
                if self.message is None and not changed:
                    self.say("done", f"The session before is kept as {self.folder / kept}.", go_back=True)
        elif before.logs:
            (self.folder / kept).unlink()
        if changed:
            self.say("error", " ".join(f"{sentence}." for sentence in changed.values()))

    # --- flying and taking away ---------------------------------------------------------------------------------------

    async def check(self) -> None:
        """Check the current model as a compensator."""
        model = self.session.model
        if model is None:
            return
        warnings: tuple[str, ...] | None = None
        refused = ""
        try:
            warnings = tuple(await asyncio.to_thread(self.simulation.check, model))
        except QuadctlError as error:
            refused = str(error)
        if model == self.session.model:  # it may have changed meanwhile
            self.results = replace(self.results, checked=warnings, refused=refused)
            self._changed()

    async def fly(self) -> None:
        """Fly the step response in the simulated world."""
        model = self.session.model
        if model is None:
            return
        async with self._working("Flying in simulation") as progress:
            steps = await self._quick.run(self.simulation.fly_steps, model, progress=progress)
            self.results = replace(self.results, steps=steps)

    def model_file(self) -> str:
        """The current model as the text of a file that the commands and the compensator read."""
        import yaml

        model = self.session.model
        if model is None:
            raise SettingsError("there is no model yet, expected a vehicle to be chosen")
        return yaml.safe_dump(model_to_dict(model, None), sort_keys=False)

    def say_exported(self, name: str) -> None:
        """Say where the browser has put the model, in a file of this name, and which commands use it."""
        self.say(
            "done",
            f"The model is saved as {name} in the downloads folder of your browser, which adds a number to a name "
            "that is taken." + (" Compensator lists the commands that use it." if self.opened.logs else ""),
        )

    async def report(self, said: Sequence[str] = (), condition: Vehicle | None = None) -> bytes | None:
        """The report as one file of HTML; None where it could not be made.

        `said` is the verdict in the words of the page; without it the report words that of the first model. It holds
        on the `condition` that this vehicle flew, where that is not known.
        """
        html: bytes | None = None
        if not self.opened.logs:
            return None
        sequence = self.session.sequence[: self.session.current + 1]
        async with self._working("Writing the report") as progress:
            shown, steps = Shown(tuple(said), condition, self.session.floor_m_s2), self.results.steps
            html = await self._quick.run(jobs.report, sequence, self.opened, steps, shown, progress=progress)
        return html
