"""Analysis on the page: the flights, the models that were made of them, and the search for what they are missing."""

from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

from quadctl.errors import QuadctlError, SettingsError
from quadctl.lab.comparison.wording import ended, listed, quantity
from quadctl.lab.evaluation import Evaluation, errors_of
from quadctl.lab.selection.refit import Refit
from quadctl.lab.study import Study
from quadctl.lab.words import in_words
from quadctl.model import Model
from quadctl.web.session.files import keep_expression
from quadctl.web.session.findings import Diagnosed, Findings
from quadctl.web.session.history import History
from quadctl.web.session.session import AUTOSAVED, Session, Step, session_to_yaml
from quadctl.web.work import jobs, reading
from quadctl.web.work.jobs import Opened
from quadctl.web.work.simulated import Simulation
from quadctl.web.work.state import LOOKING, Gathered, Message, Results, Work
from quadctl.web.work.worker import CancelledError
from quadctl.web.workbench.desk import Desk

SAME_ERROR = 0.01
"""Largest relative difference of the same fit on two computers."""


@dataclass(repr=False)
class Analysis(Desk):
    """The session with its results, and the changes of its model."""

    folder: Path
    """Folder for everything that is saved."""
    simulation: Simulation
    session: Session = field(default_factory=Session)
    opened: Opened = field(default_factory=Opened)
    results: Results = field(default_factory=Results)
    history: History = field(default_factory=History)
    accepted: frozenset[Path] = frozenset()
    """Logs that a person has said to use in spite of a doubt."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self._searches = 0

    @property
    def study(self) -> Study | None:
        """The current model on the flights, with its fit where that is known: what was evaluated last may be another
        model."""
        model, opened, evaluation = self.session.model, self.opened, self.results.evaluation
        if model is None or opened.seen is None:
            return None
        known = evaluation is not None and evaluation.comparison.model == model
        return Study(model, opened.seen, opened.unseen, evaluation.solution if evaluation and known else None)

    def session_file(self, view: str = "") -> str:
        """The session as the text of a file: its logs by path and hash, and the choices of a tab (see `Session`)."""
        known = {flight.name: flight.sha256 for flight in self.opened.flights}
        hashes = {log.path: known[log.log.name] for log in self.opened.logs if log.log and known.get(log.log.name)}
        session = replace(self.session, hashes={**self.session.hashes, **hashes}, view=view or self.session.view)
        return session_to_yaml(session)

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

    async def _with_flights(self, session: Session, known: bool = False) -> None:
        """Read the flights of `session` and evaluate its model; where that fails, nothing changes.

        Results are kept where they are `known` and the flights that can be used are the same.
        """
        async with self._working("Reading flights") as progress:
            opened = Opened()
            if session.step is not None and session.logs:
                read = await self._quick.run(reading.read_logs, session.logs, self.opened.logs, progress=progress)
                self.as_read = tuple(log.log for log in read if log.log is not None)
                self._changed()
                opened = await self._quick.run(
                    jobs.open_logs,
                    read,
                    session.unseen,
                    session.step.model.vehicle,
                    session.hold_out,
                    self.accepted,
                    progress=progress,
                )
            same = known and opened.logs and self.opened.logs and opened.usable == self.opened.usable
            if known and not same:
                session = session.unjudged()
            told = [(log.path, log.problem) for log in self.opened.logs]
            self.session, self.opened, self.results, self.as_read = session, opened, Results(), ()
            moved = self.history.each(lambda kept: kept.with_flights_of(session))
            self.history = moved if same else moved.each(Session.unjudged)
            problems = [log.problem for log in opened.logs if log.problem and (log.path, log.problem) not in told]
            if problems:
                self.message = Message("error", " ".join(ended(problem) for problem in problems))
            await self._judge(progress)

    # --- the model sequence -------------------------------------------------------------------------------------------

    async def go(self, step: int) -> None:
        """Stand on another step of the model sequence."""
        if step == self.session.current and not self.session.off:
            return
        async with self._changing_model("Comparing") as progress:
            self.session = self.session.at(step)
            await self._judge(progress)
        if self.message is None and self.session.step is not None:
            later = len(self.session.sequence) - 1 - step
            kept = "" if not later else " Later steps stay until something else is added."
            self.say("done", f"The model is now that of step {step + 1}, {self.session.step.name}.{kept}", undo=True)

    async def switch(self, effect: str) -> None:
        """Switch an effect of the current model off, or on again."""
        async with self._changing_model("Comparing") as progress:
            self.session = self.session.switched(effect)
            await self._judge(progress)

    async def add(self, *effects: str) -> None:
        """Add effects to the current model, one after the other."""
        async with self._changing_model(f"Adding {effects[0] if len(effects) == 1 else 'what is missing'}") as progress:
            for effect in effects:
                await self._extend(f"+ {effect}", progress, Study.add, effect)

    async def add_expression(self) -> None:
        """Add the expression for the unexplained residual as an effect of one's own, whose file is kept."""
        found = self.results.found
        if found is None or found.diagnosis.symbolic is None:
            return
        async with self._changing_model("Adding the expression") as progress:
            path = keep_expression(found.diagnosis.symbolic, found.diagnosis.model, self.folder)
            await self._extend("+ expression", progress, Study.add, str(path))

    async def refit(self) -> None:
        async with self._changing_model("Refitting") as progress:
            await self._extend("refitted", progress, Study.refit)

    async def remove(self, effect: str) -> None:
        async with self._changing_model(f"Removing {effect}") as progress:
            if effect in self.session.off:
                self.session = self.session.switched(effect)
            model = self.session.model
            if self.study is None and model is not None and _names(model) == [effect]:  # nothing is left to be refitted
                self.session = self.session.extended(Step(f"\N{MINUS SIGN} {effect}", replace(model, stack=())))
                return
            await self._extend(f"\N{MINUS SIGN} {effect}", progress, Study.remove, effect)

    async def undo(self) -> None:
        """Take the last change of the model back; the flights stay."""
        await self._go_to("undo", self.history.undone(self.session))

    async def redo(self) -> None:
        """Make the change again that was taken back last."""
        await self._go_to("redo", self.history.redone(self.session))

    async def _go_to(self, name: str, found: tuple[Session, History] | None) -> None:
        if found is None:
            self.say("done", f"There is no change of the model to {name}.")
            return
        session, history = found
        if session.vehicle == self.session.vehicle:
            async with self._working("Comparing") as progress:
                self.session = session
                await self._judge(progress)
        else:  # its flights must be prepared again; they are the same, and so are the errors of the history
            await self._with_flights(session)
        self.history = history
        self._changed()
        step = self.session.step
        if self.message is None and step is not None:
            off = f" without {listed(sorted(self.session.off))}" if self.session.off else ""
            self.say("done", f"The model is now that of step {self.session.current + 1}, {step.name}{off}.")

    @asynccontextmanager
    async def _changing_model(self, title: str) -> AsyncIterator[Callable[[str], None]]:
        """Run work that changes the model, so that it can be undone."""
        before = self.session
        async with self._working(title) as progress:
            yield progress
        if (self.session.sequence, self.session.model) != (before.sequence, before.model):
            self.history = self.history.after(before)
            self._changed()

    async def _extend(
        self, name: str, progress: Callable[[str], None], change: Callable[..., Refit], *effects: str
    ) -> None:
        """Make the step that a verb of `Study` gives."""
        study = self.study
        if study is None:
            raise QuadctlError("there is no flight to fit the model to: open one, or go back to a step before")
        changed: jobs.NextStep = await self._quick.run(jobs.next_step, change, study, *effects, progress=progress)
        if changed.is_repetition:
            same = "The refit gives the parameters that the model has already: they are those of the best fit to "
            self.message = Message(
                "done", f"{same}{'this flight' if len(study.seen.flights) == 1 else 'these flights'}."
            )
            return
        self.session = self.session.extended(Step(name, changed.model))
        await self._judge(progress, changed.evaluation)

    async def _judge(self, progress: Callable[[str], None], evaluation: Evaluation | None = None) -> None:
        """Evaluate the current model where that is not done yet, and begin to look for what it lacks."""
        self.results = Results(before=self.results.found or self.results.before)
        self.cancel_search()
        study = self.study
        if study is None:
            self._changed()
            return
        self._show_found()
        self._changed()
        if evaluation is None:
            evaluation = await self._quick.run(study.evaluate, progress=progress)
        aligned = study.seen.aligned_for(study.model)
        evaluation = replace(evaluation, comparison=replace(evaluation.comparison, dataset=aligned))
        self.results = replace(self.results, evaluation=evaluation)
        if not self.session.off:
            self._judged(evaluation)
            if self.results.found is None:
                self._begin(self.look())
        self._autosave()
        await self._judge_others(study, progress)

    async def _judge_others(self, study: Study, progress: Callable[[str], None]) -> None:
        """Compute the errors of the other steps on these flights, where they are not known."""
        steps = [
            i for i, step in enumerate(self.session.sequence) if step.error_m_s2 is None and i != self.session.current
        ]
        if steps:
            self._changed()
            models = [self.session.sequence[i].model for i in steps]
            errors = await self._quick.run(errors_of, models, study.seen, study.unseen, progress=progress)
            self.session = self.session.with_errors(dict(zip(steps, errors, strict=True)))
            self._autosave()

    def _judged(self, evaluation: Evaluation) -> None:
        """Keep the error of the current step; where a saved one differs from it, drop all saved results."""
        step = self.session.step
        known = None if step is None else step.error_m_s2
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
        step, seen = self.session.step, self.opened.seen
        if step is None or step.found is None or seen is None or self.session.off:
            return
        with suppress(SettingsError):  # found with another catalogue: then it is looked for again
            self.results = replace(self.results, found=step.found.diagnosed(step.model, seen))

    # --- the search ---------------------------------------------------------------------------------------------------

    async def look(self) -> None:
        """Look for what is missing, in the background."""
        study = self.study
        if study is None or self.search is not None:
            return
        self.search = Work(LOOKING)
        self._searches += 1
        number = self._searches

        def progress(text: str) -> None:
            if self.search is not None and number == self._searches:  # a search that was cancelled may still speak
                self.search = replace(self.search, detail=text)
                self._changed()

        self._changed()
        try:
            found: Findings = await self._slow.run(jobs.look_for, study, progress=progress)
            self.session = self.session.searched(study.model, found)
            self._show_found()
            self._say_found(study.model)
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
        self.say("found", f"The search has ended. {in_words(found.diagnosis.answer[0])} See What is missing.")

    async def suggest(self) -> None:
        found = self.results.found
        if found is None:
            return
        async with self._working("Choosing the next flight") as progress:
            missions = self.simulation.missions
            # The searches of earlier steps, too, may have left open which of two effects one of the model is.
            pairs = [list(pair) for pair in found.diagnosis.confounded]
            alike = [[held, other] for held, others in self.session.confounded.items() for other in others]
            asked = replace(found.diagnosis, confounded=[*pairs, *(pair for pair in alike if pair not in pairs)])
            suggestion = await self._quick.run(jobs.next_flight, asked, missions, progress=progress)
            self.results = replace(self.results, suggestion=suggestion)

    async def forecast(self) -> None:
        """Forecast the whole state of the flights by fits that have not seen them."""
        vehicle = self.session.vehicle
        if vehicle is None or self.opened.seen is None:
            return
        async with self._working("Forecasting the whole state") as progress:
            found = await self._quick.run(jobs.forecast, self.opened, self.session.unseen, vehicle, progress=progress)
            self.session = self.session.forecast(vehicle, found)
            self.history = self.history.each(lambda kept: kept.forecast(vehicle, found))
            self._autosave()

    async def gather(self, effect: str) -> None:
        """Compute the evidence for an effect of the current model, or for one that was found missing."""
        study = self._with_effect(effect)
        if study is None or self.work is not None:
            return
        self._gathered(effect, None)
        message = self.message  # the evidence that is open is gathered again when the flights change: nobody asked
        async with self._working("Gathering the evidence") as progress:
            self.message = message
            evidence = await self._quick.run(study.evidence, effect, progress=progress)
            self._gathered(effect, Gathered(evidence, self._search_for(effect)))

    def begin_to_gather(self, effect: str) -> None:
        """Compute the evidence for an effect, whatever becomes of the panel that asks for it."""
        self._begin(self.gather(effect))

    def _gathered(self, effect: str, gathered: Gathered | None) -> None:
        self.results = replace(self.results, evidence={**self.results.evidence, effect: gathered})

    def _with_effect(self, effect: str) -> Study | None:
        """Study of the current model, or of that with all effects that were found missing, whichever holds this
        effect."""
        study = self.study
        if study is None or effect in _names(study.model):
            return study
        searches = (self.results.found, self.results.before)
        best = (found.diagnosis.best for found in searches if found is not None)
        return next((replace(study, model=model, solution=None) for model in best if effect in _names(model)), None)

    def _search_for(self, effect: str) -> Diagnosed | None:
        """The last search that tried an effect; None where none on these flights did."""
        for found in (self.results.found, self.results.before):
            if found is not None and _has_tried(found, effect):
                return found
        for step in reversed(self.session.sequence[: self.session.current + 1]):
            if step.found is None or self.opened.seen is None:
                continue
            with suppress(SettingsError):  # found with another catalogue
                found = step.found.diagnosed(step.model, self.opened.seen)
                if _has_tried(found, effect):
                    return found
        return None


def _names(model: Model) -> list[str]:
    return [effect.name for effect in model.effects]


def _has_tried(found: Diagnosed, effect: str) -> bool:
    return any(candidate.effect.name == effect for candidate in found.diagnosis.ranking)
