"""Intake of the page: files that are dropped, and vehicles that are written down."""

import asyncio
import filecmp
import os
from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from quadctl.errors import QuadctlError, SettingsError
from quadctl.lab.comparison.wording import ended
from quadctl.logs.parameters import read_present_parameters
from quadctl.model import load_model, model_from_dict
from quadctl.settings import parse_yaml, read_yaml
from quadctl.vehicle_draft.draft import Answers, draft, told
from quadctl.vehicle_draft.questions import in_words_of_the_form
from quadctl.web.elements.upload import SentFile, StreamedUpload
from quadctl.web.session.files import (
    MAX_UPLOAD_BYTES,
    OWN_VEHICLES,
    SETTINGS_SUFFIXES,
    UPLOADS,
    is_inside,
    own_effects,
    require_inside,
    upload_path,
    vehicle_in,
    vehicle_path,
)
from quadctl.web.session.session import load_session
from quadctl.web.work.reading import without_folder
from quadctl.web.workbench.workbench import Workbench


@dataclass(frozen=True)
class Intake:
    """Takes files for one workbench; they are kept in its folder."""

    bench: Workbench
    vehicles: list[Path]
    """Vehicle files to choose from."""

    def receive(self, upload: StreamedUpload, take: Callable[[Sequence[SentFile]], Awaitable[None]]) -> None:
        """Keep the files of an upload in the folder of the session, and give them to `take`."""
        upload.stream_to(self.bench.folder / UPLOADS, take)

    async def take(self, files: Sequence[SentFile]) -> None:
        """Keep files that were dropped: logs are opened; a model, vehicle or session is begun with.

        While other work is in progress, they wait. A file that cannot be used does not spoil the others.
        """
        kept, problems = [], []
        for file in files:
            try:
                kept.append(await self._keep(file))
            except QuadctlError as error:
                problems.append(ended(str(error)))
        async with self.bench.in_turn([path.name for path in kept]):
            settings = [path for path in kept if path.suffix.lower() in SETTINGS_SUFFIXES]
            for path in settings:
                try:
                    await self._begin_with(path)
                except QuadctlError as error:
                    problems.append(ended(without_folder(str(error), path)))
            logs = [path for path in kept if path not in settings]
            if logs:
                await self.bench.open_logs(logs)
            if problems:
                said = self.bench.message
                more = [said.text] if said is not None and said.kind == "error" else []
                self.bench.say("error", " ".join([*problems, *more]))

    async def _begin_with(self, path: Path) -> None:
        """Begin with a session, model or vehicle, if it makes the page read nothing that was not given to it."""
        settings = read_yaml(path)
        require_inside(self.bench.folder, tuple(path.parent / file for file in own_effects(settings)))
        if "rungs" in settings:
            await self._resume(path)
        elif vehicle_in(path) is not None:
            await self.use_vehicle(path.read_text(encoding="utf-8"))
        else:
            await self.bench.begin_with(path)

    async def _resume(self, path: Path) -> None:
        """Go on with a session, if it makes the page read nothing that was not given to it."""
        session = load_session(path)
        strange = [log for log in session.logs if log not in self._known and not is_inside(self.bench.folder, log)]
        uploads = self.bench.folder / UPLOADS
        places = {log: uploads / log.name for log in strange if (uploads / log.name).is_file()}
        session = session.moved(places)
        require_inside(self.bench.folder, tuple(log for log in session.logs if log not in self._known))
        await self.bench.resume(session)

    async def take_model(self, file: SentFile) -> bool:
        """Show the model in a file beside those of the session; False, with a sentence, where it is none."""
        path = Path(file.name)
        try:
            path = await self._keep(file)
            if path.suffix.lower() not in SETTINGS_SUFFIXES:
                raise SettingsError(f"{path.name}: is no model by its name, expected a .yaml file")
            settings = read_yaml(path)
            require_inside(self.bench.folder, tuple(path.parent / own for own in own_effects(settings)))
            if "rungs" in settings:
                raise SettingsError(f"{path.name}: is a session, expected a model: drop it on Flights to open it")
            self.bench.show_beside(replace(load_model(path), name=path.name))
        except QuadctlError as error:
            self.bench.say("error", f"{without_folder(str(error), path)}.")
            return False
        return True

    @property
    def _known(self) -> tuple[Path, ...]:
        return self.bench.session.logs

    async def _keep(self, file: SentFile) -> Path:
        wanted = upload_path(self.bench.folder / UPLOADS, file.name)
        incoming = wanted.with_name(f".{wanted.name}.{os.getpid()}.tmp")
        try:
            await file.save(incoming)
            path = _free(wanted, incoming)
            incoming.replace(path)
        except OSError as error:
            raise QuadctlError(f"{wanted}: cannot be written ({error.strerror})") from None
        return path

    def refuse(self, name: str, size: float, large: bool) -> None:
        """Say why a file was refused before it was sent."""
        try:
            upload_path(self.bench.folder, name)
        except QuadctlError as error:
            self.bench.say("error", f"{error}.")
            return
        why = f"has {size / 2**20:,.0f} MB, expected at most {MAX_UPLOAD_BYTES / 2**20:.0f} MB"
        instead = f"{why}: name it on the command line instead, quadctl lab {name}."
        self.bench.say("error", f"{name}: {instead if large else 'was refused by the browser.'}")

    @property
    def own_vehicles(self) -> list[Path]:
        """Files of the vehicles that were made on the page."""
        return sorted((self.bench.folder / OWN_VEHICLES).glob("*.yaml"))

    async def use_vehicle(self, text: str, from_a_form: bool = False) -> None:
        """Begin with the vehicle that is written in `text`, and keep it as one to choose from; a form is told what is
        wrong in its own words."""
        path = vehicle_path(self.bench.folder, "")
        try:
            content = parse_yaml(text, path)
            path = vehicle_path(self.bench.folder, content.get("name"))
            model_from_dict(content, path)  # what cannot be used is not kept
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
        except QuadctlError as error:
            said = without_folder(str(error), path)
            if from_a_form:
                said = f"This vehicle cannot fly: {in_words_of_the_form(said.removeprefix(f'{path.name}: '))}"
            self.bench.say("error", f"{said}.")
            return
        except OSError as error:
            self.bench.say("error", f"{path}: cannot be written ({error.strerror}).")
            return
        await self.bench.begin_with(path)
        message = self.bench.message
        if message is None or message.kind != "error":
            kept = f"The vehicle is kept in {path.resolve()}, and stands among those to choose from."
            text = kept if message is None else f"{message.text} {kept}"
            self.bench.say("done", text, undo=message is not None and message.undo)

    async def parameters_of(self, log: Path) -> dict[str, float]:
        """Parameters that a vehicle can be drawn from, in a log; none, with a sentence, where it holds none."""
        try:
            parameters = await asyncio.to_thread(read_present_parameters, log)
            if not any(told(parameters)):
                raise SettingsError(f"{log.name}: its parameters say neither rotors nor throttle in hover")
        except QuadctlError as error:
            self.bench.say("error", f"{error}.")
            return {}
        return parameters

    async def use_new_vehicle(self, answers: Answers, parameters: Mapping[str, float]) -> None:
        """Begin with a vehicle of which a few numbers are known, and the parameters of its autopilot or none."""
        try:
            text = draft(answers, parameters)
        except SettingsError as error:
            self.bench.say("error", f"{in_words_of_the_form(str(error))}.")
            return
        await self.use_vehicle(text, from_a_form=True)


def _free(wanted: Path, incoming: Path) -> Path:
    """`wanted`, or a numbered name beside it where another file has that name: nothing is overwritten."""
    path, number = wanted, 1
    while path.exists() and not filecmp.cmp(path, incoming, shallow=False):
        number += 1
        path = wanted.with_name(f"{wanted.stem}-{number}{wanted.suffix}")
    return path
