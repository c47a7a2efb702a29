"""State of the page and the actions on it, without any user interface: all tabs show the same workbench.

Short work (open, add, remove) and the search for what is missing have a process each, so that neither waits for the
other. Whoever shows the state asks to be told when it changes.
"""

import asyncio
import logging
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from quadctl.errors import QuadctlError, SettingsError
from quadctl.lab.comparison.wording import ended, listed, plain, quantity
from quadctl.lab.evaluation import Evaluation, errors_of
from quadctl.lab.flights.dataset import Dataset, HoldOut
from quadctl.lab.report.results import Shown
from quadctl.logs.flight_log import FlightLog
from quadctl.model import Model, load_model, model_to_dict
from quadctl.vehicle import Vehicle
from quadctl.web.session.earlier import free_name
from quadctl.web.session.files import changed_logs, keep_expression, without_folder
from quadctl.web.session.findings import Diagnosed, Findings
from quadctl.web.session.session import AUTOSAVED, Rung, Session, load_session, session_to_yaml
from quadctl.web.work import jobs, reading
from quadctl.web.work.exchange import Exchange
from quadctl.web.work.simulated import Simulation
from quadctl.web.work.state import Gathered, Message, Results, Work
from quadctl.web.work.worker import CancelledError, Worker

_LOG = logging.getLogger(__name__)
SAME_ERROR = 0.01
"""Largest relative difference of the same fit on two computers."""


@dataclass(repr=False)
class Workbench:
    """One analysis: its session, its results, and the work on it."""

    folder: Path
    """Folder for everything that is saved."""
    simulation: Simulation
    session: Session = field(default_factory=Session)
    opened: jobs.Opened | None = None
    results: Results = field(default_factory=Results)
    work: Work | None = None
    search: Work | None = None
    message: Message | None = None
    as_read: tuple[FlightLog, ...] = ()
    """Logs that have been read and are being prepared."""
    waiting: tuple[str, ...] = ()
    """Names of the files that are taken as soon as the work in progress is done."""

    other_model: Model | None = None
    """Model of a file, to be drawn beside those of the session; nothing is fitted to it, nor judged by it."""
    accepted: frozenset[Path] = frozenset()
    """Logs that a person has said to use in spite of a doubt."""
    windows: int = 0
    """Number of windows and tabs of browsers that show it now."""

    def __post_init__(self) -> None:
        self._listeners: list[Callable[[], None]] = []
        self._exchange = Exchange()
        self._quick = Worker(jobs.__name__, self._exchange)
        self._slow = Worker(jobs.__name__, self._exchange, patient=True)
        self._tasks: set[asyncio.Task[None]] = set()
        self._searches = 0
        self._past: list[Session] = []
        self._future: list[Session] = []
        self._before: Session | None = None  # the session that the present one took the place of
        self._turn, self._free = asyncio.Lock(), asyncio.Event()

    # --- who looks at it ----------------------------------------------------------------------------------------------

    def subscribe(self, listener: Callable[[], None]) -> Callable[[], None]:
        """Tell `listener` of every change; calling what is given back ends that."""
        self._listeners.append(listener)
        return lambda: self._listeners.remove(listener)

    def count_window(self, more: int) -> None:
        """Count windows that show it from now on; those that do no more, with a minus sign."""
        self.windows += more
        self._changed()

    def _changed(self) -> None:
        for listener in list(self._listeners):
            try:
                listener()
            except Exception:  # a page that cannot draw itself must not stop the work, nor the other pages
                _LOG.exception("a page could not be drawn")

    def say(
        self, kind: Literal["error", "done", "found"], text: str, undo: bool = False, go_back: bool = False
    ) -> None:
        self.message = Message(kind, text, undo, go_back)
        self._changed()

    def dismiss(self, message: Message | None = None) -> None:
        """Take away the message that stands; where `message` is given, only if it is that one."""
        if message is None or message is self.message:
            self.message = None
            self._changed()

    @asynccontextmanager
    async def in_turn(self, names: Sequence[str]) -> AsyncIterator[None]:
        """Wait with files of these names until no work is in progress, and those that came before are taken."""
        self.waiting = (*self.waiting, *names)
        self._changed()
        async with self._turn:
            while self.work is not None:
                self._free.clear()
                await self._free.wait()
            self.waiting = self.waiting[len(names) :]
            self._changed()
            yield

    def close(self) -> None:
        self._quick.close()
        self._slow.close()
        self._exchange.close()

    # --- flights and model --------------------------------------------------------------------------------------------

    @property
    def unseen(self) -> Dataset | None:
        """Flights held out of all fits."""
        return None if self.opened is None else self.opened.unseen

    @property
    def seen(self) -> Dataset | None:
        return None if self.opened is None else self.opened.seen

    async def open_logs(self, paths: Sequence[Path]) -> None:
        await self._with_flights(self.session.with_logs(paths), known=True)

    async def open_sample(self) -> None:
        """Fly the vehicle in a simulated world with a hidden effect, and open the log."""
        if self.session.rung is None:
            self.say("error", "There is no vehicle yet: choose the one to fly.")
            return
        vehicle = self.session.rung.model.vehicle
        flown = None
        async with self._working("Flying a sample flight in simulation") as progress:
            flown = await self._quick.run(jobs.fly_sample, self.simulation, vehicle, progress=progress)
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
        """Begin a new ladder with the model or vehicle in a file."""
        try:
            model = load_model(path)
        except QuadctlError as error:
            self.say("error", without_folder(str(error), path))
            return
        before, past = self.session, list(self._past)
        await self._with_flights(before.unjudged().begun_with(model))
        if self.session is before or before.model is None:
            return
        self._past[:] = [*past, before]  # of the same flights
        self._future.clear()
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
        rung = self.session.rung
        if rung is not None and model.vehicle.n_rotors != rung.model.vehicle.n_rotors:
            raise SettingsError(
                f"{model.name}: has {model.vehicle.n_rotors} rotors, expected {rung.model.vehicle.n_rotors} as "
                f"{rung.model.vehicle.name} has"
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
        model = self.session.rungs[0].model if self.session.rungs else None
        kept = free_name(self.folder)
        if not self._save(kept):
            return
        before = self.session
        begun = Session() if model is None else Session().begun_with(Model(model.vehicle, name=model.vehicle.name))
        await self._with_flights(replace(begun, vehicle_assumed=True))
        if self.message is not None:
            return
        self._past, self._future, self.other_model = [], [], None
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
        if any(rung.error_m_s2 is not None for rung in session.rungs):  # its logs were in use when it was saved
            self.accepted |= set(session.logs)
        changed = await asyncio.to_thread(changed_logs, session.hashes)
        for log in changed:
            session = session.without_log(log).unjudged()
        before, kept = self.session, free_name(self.folder)
        if before.logs and not self._save(kept):
            return
        await self._with_flights(session)
        if self.session is not before:  # what was changed in another session cannot be taken back in this one
            self._past, self._future = [], []
            self._autosave()
            if before.logs:
                self._before = before
                if self.message is None and not changed:
                    self.say("done", f"The session before is kept as {self.folder / kept}.", go_back=True)
        elif before.logs:
            (self.folder / kept).unlink()
        if changed:
            self.say("error", " ".join(f"{sentence}." for sentence in changed.values()))

    async def _with_flights(self, session: Session, known: bool = False) -> None:
        """Read the flights of `session` and evaluate its model; where that fails, nothing changes.

        Results are kept where they are `known` and the flights that can be used are the same.
        """
        async with self._working("Reading flights") as progress:
            opened = None
            if session.rung is not None and session.logs:
                before = [] if self.opened is None else self.opened.logs
                read = await self._quick.run(reading.read_logs, session.logs, before, progress=progress)
                self.as_read = tuple(log.log for log in read if log.log is not None)
                self._changed()
                opened = await self._quick.run(
                    jobs.open_logs,
                    session.logs,
                    session.unseen,
                    session.rung.model.vehicle,
                    session.hold_out,
                    read,
                    self.accepted,
                    progress=progress,
                )
            same = known and opened and self.opened is not None and opened.usable == self.opened.usable
            if known and not same:
                session = session.unjudged()
            told = [] if self.opened is None else [(log.path, log.problem) for log in self.opened.logs]
            self.session, self.opened, self.results, self.as_read = session, opened, Results(), ()
            for changes in (self._past, self._future):
                moved = [change.with_flights_of(session) for change in changes]
                changes[:] = moved if same else [change.unjudged() for change in moved]
            logs = [] if opened is None else opened.logs
            problems = [log.problem for log in logs if log.problem and (log.path, log.problem) not in told]
            if problems:
                self.message = Message("error", " ".join(ended(problem) for problem in problems))
            await self._judge(progress)

    # --- the ladder ---------------------------------------------------------------------------------------------------

    async def go(self, step: int) -> None:
        """Stand on another step of the ladder."""
        if step == self.session.current and not self.session.off:
            return
        async with self._changing_model("Comparing") as progress:
            self.session = self.session.at(step)
            await self._judge(progress)
        if self.message is None and self.session.rung is not None:
            later = len(self.session.rungs) - 1 - step
            kept = "" if not later else " Later steps stay until something else is added."
            self.say("done", f"The model is now that of step {step + 1}, {self.session.rung.name}.{kept}", undo=True)

    async def switch(self, effect: str) -> None:
        """Switch an effect of the current model off, or on again."""
        async with self._changing_model("Comparing") as progress:
            self.session = self.session.switched(effect)
            await self._judge(progress)

    async def add(self, *effects: str) -> None:
        """Add effects to the current model, one after the other."""
        async with self._changing_model(f"Adding {effects[0] if len(effects) == 1 else 'what is missing'}") as progress:
            for effect in effects:
                await self._climb(f"+ {effect}", progress, jobs.add_effect, effect)

    async def add_expression(self) -> None:
        """Add the expression for the unexplained residual as an effect of one's own, whose file is kept."""
        found = self.results.found
        if found is None or found.diagnosis.symbolic is None:
            return
        async with self._changing_model("Adding the expression") as progress:
            path = keep_expression(found.diagnosis.symbolic, found.diagnosis.model, self.folder)
            await self._climb("+ expression", progress, jobs.add_expression, path)

    async def refit(self) -> None:
        async with self._changing_model("Refitting") as progress:
            await self._climb("refitted", progress, jobs.refit_model)

    async def remove(self, effect: str) -> None:
        async with self._changing_model(f"Removing {effect}") as progress:
            if effect in self.session.off:
                self.session = self.session.switched(effect)
            model = self.session.model
            if self.seen is None and model is not None and _names(model) == [effect]:  # nothing is left to be refitted
                self.session = self.session.climbed(Rung(f"\N{MINUS SIGN} {effect}", replace(model, stack=())))
                return
            await self._climb(f"\N{MINUS SIGN} {effect}", progress, jobs.remove_effect, effect)

    @property
    def can_undo(self) -> bool:
        return bool(self._past)

    @property
    def can_redo(self) -> bool:
        return bool(self._future)

    async def undo(self) -> None:
        """Take the last change of the model back; the flights stay."""
        await self._return_to("undo", self._past, self._future)

    async def redo(self) -> None:
        """Make the change again that was taken back last."""
        await self._return_to("redo", self._future, self._past)

    async def _return_to(self, name: str, there: list[Session], back: list[Session]) -> None:
        if not there:
            self.say("done", f"There is no change of the model to {name}.")
            return
        before, session = self.session, there.pop()
        if _vehicle_of(session) == _vehicle_of(before):
            async with self._working("Comparing") as progress:
                self.session = session
                await self._judge(progress)
        else:  # its flights must be prepared again
            past, future = list(self._past), list(self._future)
            await self._with_flights(session)
            self._past[:], self._future[:] = past, future  # the flights are the same, and so are the errors
        back.append(before)
        self._changed()
        rung = self.session.rung
        if self.message is None and rung is not None:
            off = f" without {listed(sorted(self.session.off))}" if self.session.off else ""
            self.say("done", f"The model is now that of step {self.session.current + 1}, {rung.name}{off}.")

    @asynccontextmanager
    async def _changing_model(self, title: str) -> AsyncIterator[Callable[[str], None]]:
        """Run work that changes the model, so that it can be undone."""
        before = self.session
        async with self._working(title) as progress:
            yield progress
        if (self.session.rungs, self.session.model) != (before.rungs, before.model):
            self._past.append(before)
            self._future.clear()
            self._changed()

    async def _climb(self, name: str, progress: Callable[[str], None], job: Callable[..., Any], *args: Any) -> None:
        model, seen = self.session.model, self.seen
        if model is None or seen is None:
            raise QuadctlError("there is no flight to fit the model to: open one, or go back to a step before")
        current = self._current(model)
        climbed: jobs.Climbed = await self._quick.run(job, *args, current, seen, self.unseen, progress=progress)
        if climbed.is_repetition:
            same = "The refit gives the parameters that the model has already: they are those of the best fit to "
            self.message = Message("done", f"{same}{'this flight' if len(seen.flights) == 1 else 'these flights'}.")
            return
        self.session = self.session.climbed(Rung(name, climbed.model))
        await self._judge(progress, climbed.evaluation)

    def _current(self, model: Model) -> jobs.Current:
        """The current model with its fit, where that is known: what was evaluated last may be another model."""
        evaluation = self.results.evaluation
        if evaluation is None or evaluation.comparison.model != model:
            return jobs.Current(model)
        return jobs.Current(model, evaluation.solution)

    async def _judge(self, progress: Callable[[str], None], evaluation: Evaluation | None = None) -> None:
        """Evaluate the current model where that is not done yet, and begin to look for what it lacks."""
        self.results = Results(before=self.results.found or self.results.before)
        self.cancel_search()
        model, opened = self.session.model, self.opened
        if model is None or opened is None or opened.seen is None:
            self._changed()
            return
        self._show_found()
        self._changed()
        if evaluation is None:
            current = jobs.Current(model)
            evaluation = await self._quick.run(jobs.evaluated, current, opened.seen, opened.unseen, progress=progress)
        evaluation = replace(
            evaluation, comparison=replace(evaluation.comparison, dataset=opened.seen.aligned_for(model))
        )
        self.results = replace(self.results, evaluation=evaluation)
        if not self.session.off:
            self._judged(evaluation)
            if self.results.found is None:
                self._begin(self.look())
        self._autosave()
        await self._judge_others(opened.seen, opened.unseen, progress)

    async def _judge_others(self, seen: Dataset, unseen: Dataset | None, progress: Callable[[str], None]) -> None:
        """Compute the errors of the other steps on these flights, where they are not known."""
        steps = [
            i for i, rung in enumerate(self.session.rungs) if rung.error_m_s2 is None and i != self.session.current
        ]
        if steps:
            self._changed()
            models = [self.session.rungs[i].model for i in steps]
            errors = await self._quick.run(errors_of, models, seen, unseen, progress=progress)
            self.session = self.session.with_errors(dict(zip(steps, errors, strict=True)))
            self._autosave()

    def _judged(self, evaluation: Evaluation) -> None:
        """Keep the error of the current step; where a saved one differs from it, drop all saved results."""
        rung = self.session.rung
        known = None if rung is None else rung.error_m_s2
        if known is not None and abs(evaluation.error_m_s2 - known) > SAME_ERROR * known:
            self.session = self.session.unjudged()
            self.results = replace(self.results, found=None)
            self.message = Message(
                "error",
                f"The saved error is {quantity(known)}, now it is {quantity(evaluation.error_m_s2)}: "
                "the logs or quadctl have changed. All results are computed again.",
            )
        self.session = self.session.judged(evaluation.error_m_s2, evaluation.floor_m_s2)

    def _show_found(self) -> None:
        """Restore the findings of an earlier search for the current step."""
        rung, seen = self.session.rung, self.seen
        if rung is None or rung.found is None or seen is None or self.session.off:
            return
        with suppress(SettingsError):  # found with another catalogue: then it is looked for again
            self.results = replace(self.results, found=rung.found.diagnosed(rung.model, seen))

    # --- the search ---------------------------------------------------------------------------------------------------

    async def look(self) -> None:
        """Look for what is missing, in the background."""
        model, seen = self.session.model, self.seen
        if model is None or seen is None or self.search is not None:
            return
        self.search = Work("Looking for what is missing")
        self._searches += 1
        number = self._searches

        def progress(text: str) -> None:
            if self.search is not None and number == self._searches:  # a search that was cancelled may still speak
                self.search = replace(self.search, detail=text)
                self._changed()

        self._changed()
        try:
            found: Findings = await self._slow.run(jobs.look_for, self._current(model), seen, progress=progress)
            self.session = self.session.searched(model, found)
            self._show_found()
            self._say_found(model)
            self._autosave()
        except CancelledError:
            pass
        except QuadctlError as error:
            self.message = Message("error", str(error))
        finally:
            if number == self._searches:
                self.search = None
            self._changed()

    def _say_found(self, model: Model) -> None:
        """Say that the search on `model` has ended, where no other message stands."""
        found = self.results.found
        if found is None or model != self.session.model or self.message is not None:
            return
        missing = [plain(family) for family in found.diagnosis.missing]
        if missing:
            said = f"missing: {listed(missing)}"
        elif found.diagnosis.verdict == "unexplained":
            said = "something is missing that no known effect explains"
        elif found.diagnosis.verdict == "small":
            said = f"measured, but small: {listed([plain(group[0].family) for group in found.diagnosis.small])}"
        else:
            said = "no further effect is missing"
        self.say("found", f"The search has ended: {said}. See What is missing.")

    def cancel_search(self) -> None:
        if self.search is not None:
            self.search = None
            self._slow.cancel()
            self._changed()

    async def suggest(self) -> None:
        found = self.results.found
        if found is None:
            return
        async with self._working("Choosing the next flight") as progress:
            missions = self.simulation.missions
            # The searches of earlier steps, too, may have left open which of two effects one of the model is.
            pairs = [list(pair) for pair in found.diagnosis.confounded]
            alike = [[held, other] for held, others in self.session.look_alikes.items() for other in others]
            asked = replace(found.diagnosis, confounded=[*pairs, *(pair for pair in alike if pair not in pairs)])
            suggestion = await self._quick.run(jobs.next_flight, asked, missions, progress=progress)
            self.results = replace(self.results, suggestion=suggestion)

    async def gather(self, effect: str) -> None:
        """Compute the evidence for an effect of the current model, or for one that was found missing."""
        seen, current = self.seen, self._with_effect(effect)
        if seen is None or current is None or self.work is not None:
            return
        self._gathered(effect, None)
        message = self.message  # the evidence that is open is gathered again when the flights change: nobody asked
        async with self._working("Gathering the evidence") as progress:
            self.message = message
            evidence = await self._quick.run(jobs.gather_evidence, effect, current, seen, progress=progress)
            self._gathered(effect, Gathered(evidence, self._search_for(effect)))

    def begin_to_gather(self, effect: str) -> None:
        """Compute the evidence for an effect, whatever becomes of the panel that asks for it."""
        self._begin(self.gather(effect))

    def _gathered(self, effect: str, gathered: Gathered | None) -> None:
        self.results = replace(self.results, evidence={**self.results.evidence, effect: gathered})

    def _with_effect(self, effect: str) -> jobs.Current | None:
        """The current model, or that with all effects that were found missing, whichever holds this effect."""
        model = self.session.model
        if model is not None and effect in _names(model):
            return self._current(model)
        searches = (self.results.found, self.results.before)
        best = (found.diagnosis.best for found in searches if found is not None)
        return next((jobs.Current(model) for model in best if effect in _names(model)), None)

    def _search_for(self, effect: str) -> Diagnosed | None:
        """The last search that tried an effect; None where none on these flights did."""
        for found in (self.results.found, self.results.before):
            if found is not None and _has_tried(found, effect):
                return found
        for rung in reversed(self.session.rungs[: self.session.current + 1]):
            if rung.found is None or self.seen is None:
                continue
            with suppress(SettingsError):  # found with another catalogue
                found = rung.found.diagnosed(rung.model, self.seen)
                if _has_tried(found, effect):
                    return found
        return None

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
            steps = await self._quick.run(jobs.fly, self.simulation, model, progress=progress)
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
            f"The model is saved as {name} in the downloads folder of your browser, with a number if need be."
            + (" Compensator lists the commands that use it." if self.opened is not None else ""),
        )

    def session_file(self, view: str = "") -> str:
        """The session as the text of a file: its logs by path and hash, and the choices of a tab (see `Session`)."""
        datasets = () if self.opened is None else (self.opened.seen, self.opened.unseen)
        known = {flight.name: flight.sha256 for dataset in datasets if dataset for flight in dataset.flights}
        logs = [] if self.opened is None else self.opened.logs
        hashes = {log.path: known[log.log.name] for log in logs if log.log and known.get(log.log.name)}
        session = replace(self.session, hashes={**self.session.hashes, **hashes}, view=view or self.session.view)
        return session_to_yaml(session)

    async def report(self, said: Sequence[str] = (), condition: Vehicle | None = None) -> bytes | None:
        """The report as one file of HTML; None where it could not be made.

        `said` is the verdict in the words of the page; without it the report words that of the first model. It holds
        on the `condition` that this vehicle flew, where that is not known.
        """
        html: bytes | None = None
        if self.opened is None:
            return None
        ladder = self.session.rungs[: self.session.current + 1]
        async with self._working("Writing the report") as progress:
            floor = self.session.floor_m_s2
            shown = Shown(tuple(said), condition, floor)
            html = await self._quick.run(jobs.report, ladder, self.opened, self.results.steps, shown, progress=progress)
        return html

    # --- how work is done ---------------------------------------------------------------------------------------------

    def cancel(self) -> None:
        """End the work that is being done."""
        self._quick.cancel()

    @asynccontextmanager
    async def _working(self, title: str) -> AsyncIterator[Callable[[str], None]]:
        """Run one work at a time: show its progress, and say so when it fails or is cancelled."""
        if self.work is not None:
            self.say("error", f"{self.work.title} is not finished yet: wait for it, or cancel it.")
            raise CancelledError
        self.work = Work(title)
        self.message = None
        self._changed()

        def progress(text: str) -> None:
            self.work = Work(title, text)
            self._changed()

        try:
            yield progress
        except CancelledError:
            self.message = Message("done", f"{title} was cancelled; nothing is lost.")
        except QuadctlError as error:
            self.message = Message("error", str(error))
        finally:
            self.work, self.as_read = None, ()
            self._free.set()
            self._changed()

    def _begin(self, work: Awaitable[None]) -> None:
        task = asyncio.ensure_future(work)
        self._tasks.add(task)  # asyncio itself holds tasks only weakly
        task.add_done_callback(self._tasks.discard)

    def _autosave(self) -> None:
        self._save(AUTOSAVED)

    def _save(self, name: str) -> bool:
        """Write the session to the file `name` of the folder; False, with a sentence, where that fails."""
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            part = self.folder / f".{name}.part"
            part.write_text(self.session_file(), encoding="utf-8")
            part.replace(self.folder / name)  # whole or not at all, also in a power failure
        except OSError as error:
            self.message = Message("error", f"{self.folder / name}: cannot be written ({error.strerror})")
            return False
        return True


def _names(model: Model) -> list[str]:
    return [effect.name for effect in model.effects]


def _has_tried(found: Diagnosed, effect: str) -> bool:
    return any(candidate.effect.name == effect for candidate in found.diagnosis.ranking)


def _vehicle_of(session: Session) -> Vehicle | None:
    """Vehicle of a session's models; None before one is chosen."""
    return session.rungs[0].model.vehicle if session.rungs else None
