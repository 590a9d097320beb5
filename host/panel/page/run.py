"""The Run tab: choose a job or upload a file, see what it does, then let the machine do it."""

import asyncio
from collections.abc import Callable
from typing import Any, Final

from nicegui import events, ui

from steptwin.host.common.arrays import FloatArray
from steptwin.host.panel.desk import AS_SLOW_AS_NEEDED, MOVE_TO_START, RunMotion, Snapshot
from steptwin.host.panel.page.elements import act, choice, line, note, number_field, plain, stack
from steptwin.host.panel.page.guard import BODY_BYTES_MAX
from steptwin.host.panel.page.motions import ENDINGS, path_mm, plan_job, plan_upload
from steptwin.host.panel.page.option_titles import option_title
from steptwin.host.panel.page.scene import ArmScene, links_at
from steptwin.host.panel.page.visitor import Visitor
from steptwin.host.planning.jobs import job_fields, job_names, job_summary
from steptwin.host.planning.jobs.options import OptionField
from steptwin.host.planning.peaks import Quantity
from steptwin.host.planning.plan import Plan

_FILE: Final = "a file of yours"
_PACES: Final = {"1": "as planned", "2": "half speed", "4": "quarter speed", "auto": AS_SLOW_AS_NEEDED}
_REPETITIONS_MAX: Final = 1000


class RunTab:
    """A motion, its options, its preview, and the button that starts it."""

    def __init__(self, visitor: Visitor, scene: ArmScene) -> None:
        self._visitor, self._scene = visitor, scene
        self._plan: Plan | None = None
        self._name = ""
        self._upload: tuple[str, bytes] | None = None
        jobs = job_names(visitor.desk.robot)
        self._form: OptionForm | None = None
        with line("between top"):
            titles = {name: name for name in jobs} | {_FILE: _FILE}
            self._choice = ui.select(titles, value=jobs[0] if jobs else _FILE, label="motion").props("outlined dense")
            self._choice.classes("w-field").on_value_change(self._choose)
            with line("tight"):
                ui.label("Speed").classes("muted")
                self._pace = choice("speed of the run", _PACES, "1", lambda _: self._outdate())
        self._summary = ui.label().classes("muted")
        self._options = stack()
        with line():
            self._repeat = number_field("repetitions", 1, 1, _REPETITIONS_MAX, "", whole=True).classes("w-narrow")
            self._approach = ui.switch(f"{MOVE_TO_START}, straight in the joints", value=True)
        with line():
            self._preview = plain("Preview", self._look, "visibility")
            self._start = act("Run", self._run, "play_arrow")
        self._figures = ui.element("div").classes("stack tight")
        self._choose()

    def refresh(self, _snapshot: Snapshot) -> None:
        """Nothing here follows the machine; the head shows the progress."""

    def _choose(self) -> None:
        """Show the options of the chosen job, or the place for a file."""
        name = str(self._choice.value)
        self._options.clear()
        self._outdate()
        with self._options:
            if name == _FILE:
                self._form = None
                self._summary.set_text("A trajectory in CSV or JSON, or a program in TOML.")
                self._upload_field()
            else:
                robot = self._visitor.desk.robot
                self._summary.set_text(job_summary(robot, name))
                self._form = OptionForm(job_fields(robot, name), self._outdate)

    def _upload_field(self) -> None:
        upload = ui.upload(
            label=f"choose or drop a file: {', '.join(ENDINGS)}",
            auto_upload=True,
            max_file_size=BODY_BYTES_MAX,
            on_upload=self._take,
            on_rejected=lambda: self._visitor.tell(
                f"refused: it ends in none of {', '.join(ENDINGS)}, or is too large"
            ),
        )
        upload.props(f"accept={','.join(ENDINGS)} flat bordered").classes("upload")

    async def _take(self, event: events.UploadEventArguments) -> None:
        self._upload = event.file.name, await event.file.read()
        self._summary.set_text(f"Chosen: {event.file.name}")
        self._outdate()
        await self._look()

    def _outdate(self) -> None:
        """Forget the preview, since something has changed: only what was seen can be run."""
        self._plan = None
        self._start.set_enabled(False)

    async def _look(self) -> None:
        """Plan the motion and show its path and figures."""
        make = self._maker()
        if make is None:
            return
        self._outdate()
        self._figures.clear()
        self._preview.set_enabled(False)
        with self._visitor.explained() as failed:
            plan = await asyncio.to_thread(make)
            self._show(plan, await asyncio.to_thread(path_mm, plan))
        self._preview.set_enabled(True)
        if failed:
            self._scene.clear_shape("plan")
            with self._figures:
                note(failed[0], "bad")

    def _show(self, plan: Plan, path: FloatArray) -> None:
        """Show a plan, which may be run from now on."""
        self._plan = plan
        with self._figures:
            show_figures(plan)
        self._scene.show_line("plan", path)
        self._scene.show_arm("ghost", links_at(plan.robot, plan.start_joints))
        self._start.set_enabled(True)

    def _maker(self) -> Callable[[], Plan] | None:
        """Return the function that plans what is chosen; None, with a message, if something is missing or wrong."""
        robot = self._visitor.desk.robot
        pace = str(self._pace.value)
        stretch = None if pace == "auto" else float(pace)
        name = str(self._choice.value)
        if name == _FILE:
            if self._upload is None:
                self._visitor.tell("choose a file first")
                return None
            upload = self._upload
            self._name = upload[0]
            return lambda: plan_upload(robot, *upload, stretch)
        texts = self._form.texts() if self._form else {}
        if texts is None:
            self._visitor.tell("an option has no value, or one outside its range")
            return None
        self._name = name
        return lambda: plan_job(robot, name, texts, stretch)

    def _run(self) -> None:
        if self._plan is None or not self._repeat.validate():
            self._visitor.tell("look at the preview first")
            return
        command = RunMotion(
            plan=self._plan, name=self._name, repeat=int(self._repeat.value), approach=bool(self._approach.value)
        )
        if self._visitor.ask(command):
            self._scene.clear_shape("ghost")
            self._scene.clear_shape("trace")


class OptionForm:
    """A field for each of a job's options, with the job's own defaults and ranges."""

    def __init__(self, fields: tuple[OptionField, ...], changed: Callable[[], None]) -> None:
        self._fields: dict[str, ui.number | ui.select | ui.input] = {}
        with ui.element("div").classes("form-grid"):
            for field in fields:
                self._fields[field.name] = _form_field(field, changed)

    def texts(self) -> dict[str, str] | None:
        """Return the options as texts, as on the command line; None while one is missing or out of range."""
        texts = {}
        for name, field in self._fields.items():
            if isinstance(field, ui.number) and not field.validate():
                return None
            texts[name] = _text(field.value)
        return texts


def _form_field(field: OptionField, changed: Callable[[], None]) -> ui.number | ui.select | ui.input:
    label = option_title(field)
    if field.form:
        text = ui.input(f"{label} ({field.form})", value=str(field.default), on_change=lambda _: changed())
        return text.props("outlined dense").classes("w-field")
    if field.allowed is None:
        select = ui.select(list(field.choices), value=field.default, label=label, on_change=lambda _: changed())
        return select.props("outlined dense").classes("w-field")
    allowed = field.allowed
    default = round(float(field.default), 6)
    return number_field(label, default, allowed.lower, allowed.upper, allowed.unit, changed, whole=field.whole)


def _text(value: Any) -> str:
    return f"{value:.12g}" if isinstance(value, int | float) else str(value)


def show_figures(plan: Plan) -> None:
    """Show how long a plan takes and how near it comes to the limits."""
    speed, acceleration = plan.highest(Quantity.SPEED), plan.highest(Quantity.ACCELERATION)
    note(
        f"{plan.trajectory.duration_s:.2f} s; highest speed {speed.percent:.0f} % of the limit ({speed.joint}), "
        f"highest acceleration {acceleration.percent:.0f} % ({acceleration.joint}). "
        "It keeps all limits: run it when the blue path is what you want.",
        "good",
    )
