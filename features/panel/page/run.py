"""The Run tab: choose a job or upload a file, preview its motion, then run it on the machine."""

import asyncio
from collections.abc import Awaitable, Callable, Coroutine, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import PurePath
from typing import Any, Final

from nicegui import events, ui

from steptwin.features.panel.page.elements import (
    Chip,
    Form,
    FormField,
    act,
    choice,
    icon_button,
    line,
    make_input,
    note,
    plain,
    stack,
    titled,
    wrong,
)
from steptwin.features.panel.page.guard import BODY_BYTES_MAX
from steptwin.features.panel.page.motions import (
    UNITS,
    USUAL_UNITS,
    Planned,
    UploadedMotion,
    option_title,
    path_mm,
    plan_apart,
    plan_job,
)
from steptwin.features.panel.page.scene import ArmScene, links_at
from steptwin.features.panel.page.uploads import RUNNABLE, companions, to_run
from steptwin.features.panel.page.visitor import SHOWN, Visitor
from steptwin.features.panel.service.commands import RunMotion
from steptwin.features.panel.service.messages import AS_SLOW_AS_NEEDED, MOVE_TO_START
from steptwin.features.panel.service.snapshots import Snapshot
from steptwin.host.common.arrays import FloatArray
from steptwin.host.planning.jobs import job_fields, job_names, job_summary
from steptwin.host.planning.jobs.options import OptionField, OptionRange
from steptwin.host.planning.peaks import Quantity
from steptwin.host.planning.plan import Plan

_FILES_MAX: Final = 20
"""Largest number of files at once."""


class Upload:
    """Field for dropping files; it names the file to run and those that belong to it.

    Attributes:
        files: contents by name, the newest last.
    """

    def __init__(self, changed: Callable[[], Awaitable[None]], refused: Callable[[str], None]) -> None:
        """Create it; `changed` is called when the files change, `refused` with the reason for a refused file."""
        self.files: dict[str, bytes] = {}
        self._changed, self._refused = changed, refused
        self.root: ui.element = stack("tight")
        with self.root:
            self._field = ui.upload(
                label=f"choose or drop files: {', '.join(RUNNABLE)}",
                multiple=True,
                auto_upload=True,
                max_file_size=BODY_BYTES_MAX,
                max_total_size=BODY_BYTES_MAX,
                max_files=_FILES_MAX,
                on_multi_upload=self._take,
                on_rejected=self._reject,
            )
            self._field.props(f"accept={','.join(RUNNABLE)} flat bordered").classes("upload")
            with line() as self._row:
                self._name = ui.label()
                icon_button("close", "take the file away", self._take_away)
        self.show({})

    @property
    def main(self) -> str | None:
        """Name of the file to run; None without one."""
        return to_run(self.files)

    @property
    def beside(self) -> dict[str, bytes]:
        """The other files."""
        return {name: self.files[name] for name in companions(self.files)}

    def show(self, files: Mapping[str, bytes]) -> None:
        """Set the files without calling `changed`."""
        self.files = dict(files)
        name = self.main
        self._row.set_visibility(name is not None)
        if name is not None:
            beside = f", with {', '.join(self.beside)}" if self.beside else ""
            self._name.set_text(f"Chosen: {name}, {_size_words(len(self.files[name]))}{beside}")

    async def _take(self, event: events.MultiUploadEventArguments) -> None:
        """Add files, and keep only those that belong to the file to run."""
        self._field.reset()  # its own list would grow, with a tick at each file
        files = self.files
        for file in event.files:
            name = PurePath(file.name).name
            files = {other: content for other, content in files.items() if other != name} | {name: await file.read()}
        main = to_run(files)
        kept = {name: files[name] for name in (*companions(files), *([main] if main else []))}
        if len(kept) > _FILES_MAX or sum(map(len, kept.values())) > BODY_BYTES_MAX:
            self._reject()
            return
        self.show(kept)
        await self._changed()

    async def _take_away(self) -> None:
        self.show({})
        await self._changed()

    def _reject(self) -> None:
        self._field.reset()
        self._refused(
            f"refused: a file ends in none of {', '.join(RUNNABLE)}, they have more than {_size_words(BODY_BYTES_MAX)},"
            f" or they are more than {_FILES_MAX}"
        )


def _size_words(size_bytes: int) -> str:
    if size_bytes < 1000:
        return f"{size_bytes} bytes"
    return f"{size_bytes / 1e3:.3g} kB" if size_bytes < 1_000_000 else f"{size_bytes / 1e6:.3g} MB"


_FILE: Final = "a file of yours"
_PACES: Final = {"1": "as planned", "2": "half speed", "4": "quarter speed", "auto": AS_SLOW_AS_NEEDED}
_SPEEDS_PERCENT: Final = (10, 25, 50, 75, 100, 125, 150)
"""Speeds of a running motion, in percent of the planned one."""
_REPETITIONS_MAX: Final = 1000


@dataclass(slots=True, eq=False)
class Preview:
    """A previewed motion, which may be run.

    Attributes:
        name: its name.
        plan: its plan.
        path_mm: the tool's path, shape (n, 3).
        doubted: question about its file's units; None without one.
        ran: True if it was run; its path then stays until the next preview.
    """

    name: str
    plan: Plan
    path_mm: FloatArray
    doubted: str | None
    ran: bool = False


class RunTab:
    """A motion, its options, its preview, and the button that starts it.

    Attributes:
        form: options of a job; None for a user's file.
        upload: the user's files.
        kept: further inputs that survive a reload of the tab.
        shown: motion that may be run; None without a preview.
    """

    def __init__(self, visitor: Visitor, scene: ArmScene) -> None:
        self._visitor, self._scene = visitor, scene
        self.shown: Preview | None = None
        self._planning: asyncio.Task[Planned] | None = None
        visitor.page.on_delete(self._end_planning)
        jobs = job_names(visitor.service.robot)
        self.form: Form | None = None
        with line("top"):
            titles = {name: name for name in jobs} | {_FILE: _FILE}
            self._choice = ui.select(titles, value=jobs[0] if jobs else _FILE, label="motion").props("outlined dense")
            self._choice.classes("w-motion").on_value_change(self._choose)
            self._preview = plain("Preview", self._look, "visibility")
            self._start = act("Run", self._run, "play_arrow", moves=True)
        self._figures = ui.element("div").classes("stack tight")
        with titled("Speed", "tight"):
            self._pace = choice("speed of the run", _PACES, "1", lambda _: self._outdate())
        with titled("On the way", "tight"):
            self._speeds = [
                plain(f"{percent} %", partial(self._change_speed, percent), label=label, moves=True)
                for percent, label in ((each, f"{each} % of the planned speed") for each in _SPEEDS_PERCENT)
            ]
            self._speed = Chip(classes="said")
        self._summary = ui.label().classes("muted")
        self._options = stack()
        self.upload = Upload(self._other_file, visitor.tell)
        with titled("Its units", "tight") as self._of_a_file:
            self._units = choice("units of a trajectory file", UNITS, USUAL_UNITS, lambda _: self._outdate())
        with line():
            repeat = FormField("repeat", "repetitions", 1, OptionRange(1, _REPETITIONS_MAX, ""), whole=True)
            self._repeat = make_input(repeat).classes("w-narrow")
            self._approach = ui.switch(f"{MOVE_TO_START}, straight in the joints", value=True)
        self.kept = (self._choice, self._pace, self._repeat, self._approach, self._units)
        self._choose()

    def refresh(self, snapshot: Snapshot) -> None:
        self._start.set_enabled(self.shown is not None and snapshot.activity is None)
        on_the_way = snapshot.activity is not None and snapshot.activity.pausable
        for button in self._speeds:
            button.set_enabled(on_the_way)
        percent = snapshot.speed_percent if on_the_way else None
        self._speed.show("" if percent is None else f"runs at {percent:.0f} %" if percent else "at standstill")

    def _change_speed(self, percent: int) -> None:
        visitor = self._visitor
        visitor.attempt(lambda: visitor.service.change_speed(visitor.tab, percent, SHOWN.get()))

    def go_on(self, before: "RunTab") -> None:
        """Restore what another tab has shown, since the page was loaded again."""
        self.upload.show(before.upload.files)
        for field, same in zip(self.kept, before.kept, strict=True):
            field.set_value(same.value)
        if self.form and before.form:
            self.form.fill(before.form.values())
        if before.shown is not None:
            self._show(before.shown)

    def _choose(self) -> None:
        name, robot = str(self._choice.value), self._visitor.service.robot
        of_a_file = name == _FILE
        self._options.clear()
        self._outdate()
        self.upload.root.set_visibility(of_a_file)
        self._of_a_file.set_visibility(of_a_file)
        files = "A trajectory in CSV, JSON or YAML, G-code, or a program in TOML, with its files."
        self._summary.set_text(files if of_a_file else job_summary(robot, name))
        with self._options:
            self.form = None if of_a_file else Form(map(_form_field, job_fields(robot, name)), self._outdate)

    async def _other_file(self) -> None:
        self._outdate()
        if self.upload.main is not None:
            await self._look()

    def _outdate(self) -> None:
        """Drop the preview after a change: only what was seen can be run."""
        self._end_planning()
        if self.shown is not None and not self.shown.ran:
            self._show_path(None)
        self.shown = None
        self._figures.clear()
        self._start.set_enabled(False)

    async def _look(self) -> None:
        """Plan the motion and show its path and figures, unless inputs change or the page closes meanwhile."""
        name, make = self._maker()
        if make is None:
            return
        self._outdate()
        self._preview.set_enabled(False)
        try:
            with self._visitor.explained(message=False) as failed:
                self._planning = asyncio.create_task(make())
                plan, doubted = await self._planning
                path = await asyncio.to_thread(path_mm, plan)
                self._show(Preview(name, plan, path, doubted))
                self._show_path(path)
                self._scene.show_arm("ghost", links_at(plan.robot, plan.start_joints))
        finally:
            self._preview.set_enabled(True)
        if failed:
            self._show_path(None)
            with self._figures:
                note(failed[0], "bad")

    def _end_planning(self) -> None:
        if self._planning is not None:
            self._planning.cancel()

    def _show(self, preview: Preview) -> None:
        """Show the duration of a plan and its distance from the limits; it may be run from now on."""
        self.shown, plan = preview, preview.plan
        speed, acceleration = plan.highest(Quantity.SPEED), plan.highest(Quantity.ACCELERATION)
        with self._figures:
            note(
                f"{plan.motion.duration_s:.2f} s; highest speed {speed.percent:.0f} % of the limit ({speed.joint}),"
                f" highest acceleration {acceleration.percent:.0f} % ({acceleration.joint}). "
                "It keeps all limits: run it when the blue path is what you want.",
                "good",
            )
            if preview.doubted:
                note(f"Look again: {preview.doubted}", "warn")
        self.refresh(self._visitor.service.snapshot)

    def _show_path(self, path: FloatArray | None) -> None:
        """Show a path, or none: the operator's in every browser, a watcher's in its own alone."""
        drawing = self._visitor.service.drawing
        if not self._visitor.operates:
            self._scene.show_line("plan", drawing.path_mm if path is None else path)
        elif path is None:
            drawing.clear_path()
        else:
            drawing.show_path(path)

    def _maker(self) -> tuple[str, Callable[[], Coroutine[Any, Any, Planned]] | None]:
        """Return the name of the chosen motion, and the function that plans it.

        If an input is missing or wrong, there is a message in place of the function.
        """
        robot, name, upload = self._visitor.service.robot, str(self._choice.value), self.upload
        stretch = None if self._pace.value == "auto" else float(self._pace.value)
        if self.form is None:
            main = upload.main
            if main is None:
                self._visitor.tell("choose a file first")
                return name, None
            file = UploadedMotion(robot, main, upload.files[main], stretch, str(self._units.value), upload.beside)
            return main, lambda: plan_apart(file)
        missing = self.form.wrong()
        if missing is not None:
            self._visitor.tell(missing)
            return name, None
        texts = {option: _text(value) for option, value in self.form.values().items()}
        return name, lambda: asyncio.to_thread(lambda: (plan_job(robot, name, texts, stretch), None))

    def _run(self) -> None:
        missing, shown = wrong([self._repeat]), self.shown
        if shown is None or missing is not None:
            self._visitor.tell(missing or "look at the preview first")
            return
        repeat, approach = int(self._repeat.value), bool(self._approach.value)
        if self._visitor.ask(RunMotion(shown.plan, shown.name, repeat, approach)):
            shown.ran = True
            self._show_path(shown.path_mm)
            self._visitor.service.drawing.clear_trace()
            self._scene.clear_shape("ghost")


def _form_field(option: OptionField) -> FormField:
    title = option_title(option)
    if option.form:
        return FormField(option.name, f"{title} ({option.form})", option.default)
    default = option.default if option.allowed is None else round(float(option.default), 6)
    return FormField(option.name, title, default, option.allowed, option.whole, option.choices)


def _text(value: Any) -> str:
    return f"{value:.12g}" if isinstance(value, int | float) else str(value)
