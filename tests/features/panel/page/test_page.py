"""The page without a browser: what it shows of a service, and what it asks of it."""

import asyncio
import json
from collections.abc import AsyncIterator, Callable, Coroutine
from contextlib import asynccontextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("nicegui", reason="the extra `panel` is not installed")

import httpx
import numpy as np
from nicegui import core, ui
from nicegui.element import Element
from nicegui.testing import User, UserInteraction, user_simulation

from steptwin.features.panel.page import visitor
from steptwin.features.panel.page.hub import Hub, tick_of
from steptwin.features.panel.page.motions import Planned, UploadedMotion, plan_upload
from steptwin.features.panel.page.visitor import SHOWN, note_shown
from steptwin.features.panel.service.commands import (
    Disable,
    HomeAll,
    HomeJoint,
    JointJog,
    MoveJoints,
    MoveTool,
    ResetFaults,
    RunMotion,
    StepJoint,
    StepTool,
    SwitchOutput,
    ToolJog,
    WriteSettings,
)
from steptwin.features.panel.service.results import Placed, Result
from steptwin.features.panel.service.settings import Setting
from steptwin.features.panel.service.snapshots import Activity, BoardFigures
from steptwin.host.client.words import STOP_PRESSED
from steptwin.host.operate.running import AxisEnd, LiveOutcome
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.planner import plan
from steptwin.host.planning.tool_by_hand import StepFrame
from steptwin.host.robots import load_robot, robot_names
from tests.features.panel.page.scripted_service import ScriptedService

pytestmark = pytest.mark.slow

LAB = load_robot("lab-scara")


class Rig:
    """A page, its service and its simulated user."""

    def __init__(self, user: User, hub: Hub, service: ScriptedService) -> None:
        self.user, self.hub, self.service = user, hub, service

    async def look(self) -> None:
        """Let the page follow the service."""
        await self.hub.tick()
        await asyncio.sleep(0)

    def texts(self) -> list[str]:
        """Return the texts of all elements that are shown."""
        return [str(element.text) for element in self.elements() if isinstance(element, ui.label | ui.button)]

    def shows(self, part: str) -> bool:
        """Return whether a text with this part is shown, on the page or in a message."""
        return any(part in text for text in (*self.texts(), *self.user.notify.messages))

    def elements(self) -> list[Element]:
        assert self.user.client
        return [element for element in self.user.client.elements.values() if _visible(element)]

    def find(self, name: str, kind: type[Element] = ui.button) -> Any:
        """Return the only element with a text, label or accessible name."""
        found = [element for element in self.elements() if isinstance(element, kind) and name in _names(element)]
        assert len(found) == 1, (name, len(found))
        return found[0]

    def first(self, label: str) -> ui.number:
        """Return the first field for a number with a label: the Move tab is before the Run tab."""
        return next(each for each in self.elements() if isinstance(each, ui.number) and label in _names(each))

    async def click(self, name: str) -> None:
        """Click a button that is enabled."""
        button = self.find(name)
        assert button.enabled, name
        await self.trigger(button, "click")

    async def trigger(self, element: Element, event: str, args: Any = None) -> None:
        """Let an element have an event."""
        UserInteraction(self.user, {element}, None).trigger(event, args)
        for _ in range(5):
            await asyncio.sleep(0)
        await self.look()

    async def emit(self, event: str, **args: Any) -> None:
        """Let the page's script send an event."""
        assert self.user.client
        await self.trigger(self.user.client.layout, event, args)

    async def press(self, stop: str, press: str) -> Any:
        """Send a stop as the page's script does, by a request of its own; return the answer."""
        assert self.user.client
        query = {"press": press, "page": self.user.client.id}
        response = await self.user.http_client.post(f"/{stop}", params=query)
        assert response.status_code == 200
        return response.json()

    async def until(self, condition: Callable[[], bool]) -> None:
        """Wait for a motion to be planned, in a thread."""
        for _ in range(2000):
            if condition():
                return
            await asyncio.sleep(0.01)
        raise AssertionError(self.texts())

    def branch(self, name: str) -> Element:
        """Return the row of a branch of the inverse kinematics."""
        row: Element
        (row,) = [
            element
            for element in self.elements()
            if element.props.get("role") == "radio" and any(name in _names(child) for child in element.descendants())
        ]
        return row

    @property
    def asked(self) -> list[Any]:
        """The commands that the service has agreed to."""
        return [command for _, command in self.service.asked]


def _visible(element: Element) -> bool:
    """Return whether an element and all that it is in are shown; tabs count as shown."""
    return element.visible and all(ancestor.visible for ancestor in element.ancestors())


def _names(element: Element) -> set[str]:
    props = element.props
    return {str(props.get("aria-label")), str(props.get("label")), str(getattr(element, "text", None))}


@asynccontextmanager
async def opened(service: ScriptedService, folder: Path, control: Any = None) -> AsyncIterator[Rig]:
    """Open the page of a service."""
    hub = Hub(service, str(folder / "positions.toml"), control)
    async with user_simulation(root=hub.build) as user:
        hub.start()
        await user.open("/")
        rig = Rig(user, hub, service)
        await asyncio.sleep(0)
        await rig.look()
        yield rig


@pytest.fixture(autouse=True)
def _planned_here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Plan uploaded files in a thread, not in a process, which test_planning_apart tries."""

    async def plan_here(file: UploadedMotion) -> Planned:
        return await asyncio.to_thread(plan_upload, file)

    monkeypatch.setattr("steptwin.features.panel.page.run.plan_apart", plan_here)


Body = Callable[[Rig], Coroutine[Any, Any, None]]


@pytest.fixture
def on_page(tmp_path: Path) -> Callable[..., ScriptedService]:
    """Return a function that runs a body on an open page, of lab-scara by default, and returns the service."""

    def run(body: Body, service: ScriptedService | None = None) -> ScriptedService:
        service = service or ScriptedService(LAB)

        async def opened_body() -> None:
            async with opened(service, tmp_path) as rig:
                await body(rig)

        asyncio.run(opened_body())
        return service

    return run


OnPage = Callable[..., ScriptedService]


# --- what is shown


@pytest.mark.parametrize("name", robot_names())
def test_every_robot_has_its_page(name: str, on_page: OnPage) -> None:
    robot = load_robot(name)

    async def body(rig: Rig) -> None:
        assert rig.shows(name)
        assert rig.shows("SIMULATED")
        for joint in robot.joint_names:
            assert rig.find(f"jog {joint} forward")
        for output in robot.outputs:
            assert rig.find(f"switch {output} on")
        scene = next(element for element in rig.user.client.elements.values() if "roles" in element.props)  # type: ignore[union-attr]
        assert len(scene.props["roles"]) == len(rig.service.now.links_mm)
        assert len(scene.props["boxes"]) == len(robot.boxes)

    on_page(body, ScriptedService(robot))


def test_what_is_in_the_way_is_said_with_the_remedy(on_page: OnPage) -> None:
    async def body(rig: Rig) -> None:
        service = rig.service
        assert not rig.shows("Not homed")
        service.show_joints(homed=False)
        await rig.look()
        assert rig.shows("Not homed: d1, th2, th3, th4.")
        service.show_joints(homed=True, error="the motor does not follow: is it blocked?")
        await rig.look()
        assert "Fault: d1, th2, th3, th4: the motor does not follow: is it blocked?" in rig.texts()
        await rig.click("Reset")
        assert isinstance(rig.asked[-1], ResetFaults)
        service.show_joints(error=None)
        service.show(emergency_stopped=True)
        await rig.look()
        assert rig.shows("Emergency stop: nothing moves until the reset.")
        service.show(connected=False, why_not="no report from the machine for 0.5 s")
        await rig.look()
        assert rig.shows("Not connected: no report from the machine for 0.5 s.")
        assert any("unseen" in element.classes for element in rig.user.client.elements.values())  # type: ignore[union-attr]
        service.show(connected=True, why_not=None, emergency_stopped=False)
        await rig.look()
        assert not any(rig.shows(text) for text in ("Not connected", "Emergency stop", "Fault", "Not homed"))

    on_page(body)


def test_a_drive_that_cannot_be_switched_on_says_why(on_page: OnPage) -> None:
    async def body(rig: Rig) -> None:
        service = rig.service
        service.show_joints(hindrance=STOP_PRESSED, state="off")
        await rig.look()
        assert rig.shows("The drives cannot be switched on: the machine's emergency stop is pressed.")
        assert rig.texts().count("off: the machine's emergency stop is pressed") == len(LAB.joints)
        service.show(emergency_stopped=True)
        await rig.look()
        assert rig.shows("Emergency stop: pull its button out at the machine, then reset.")
        hot, *others = service.now.joints
        free = [replace(joint, hindrance=None) for joint in others]
        service.show(emergency_stopped=False, joints=(replace(hot, hindrance="its driver is too hot"), *free))
        await rig.look()
        assert rig.shows("The drives cannot be switched on: d1: its driver is too hot.")

    on_page(body)


def test_before_the_first_connection_the_page_looks_for_the_machine(on_page: OnPage) -> None:
    async def body(rig: Rig) -> None:
        rig.service.show(connected=False, why_not="looking for the machine", joints=())
        await rig.look()
        assert "Not connected: looking for the machine." in rig.texts()

    on_page(body)


def test_a_joint_that_is_not_homed_has_no_position_and_may_be_told_where_it_stands(on_page: OnPage) -> None:
    async def body(rig: Rig) -> None:
        rig.service.show_joints(homed=False)
        await rig.look()
        assert tick_of(rig.service.now)["known"] == [False] * len(LAB.joints)
        unknown = [element for element in rig.elements() if "unknown" in element.classes]
        assert len(unknown) == len(LAB.joints)
        rig.first("th3").set_value(30.0)
        await rig.click("Declare as position")
        assert rig.asked[-1].joints == (LAB.home[0], LAB.home[1], 30.0, LAB.home[3])
        await rig.click("Fill in present position")
        assert rig.first("th3").value is None
        await rig.click("Move")
        assert rig.shows("where the joints are is unknown: home the machine first")
        await rig.click("Declare as position")
        assert rig.shows("d1: there is no number; it takes ")
        assert len(rig.asked) == 1

    on_page(body)


def test_the_head_follows_the_activity(on_page: OnPage) -> None:
    async def body(rig: Rig) -> None:
        assert not rig.find("Pause").enabled
        rig.service.show(activity=Activity("spiral", 0.42, paused=False, pausable=True))
        await rig.look()
        assert rig.shows("spiral 42 %")
        await rig.click("Pause")
        rig.service.show(activity=Activity("spiral", 0.42, paused=True, pausable=True))
        await rig.look()
        assert rig.shows("spiral 42 %, paused")
        await rig.click("Resume")
        tab = rig.user.tab_id
        names = [call for call in rig.service.calls if call[0] != "gone"]
        assert names == [
            ("pause", "browser 1"),
            ("resume", tab),
        ]

    on_page(body)


def test_the_run_tab_changes_the_speed_on_the_way(on_page: OnPage) -> None:
    """While a trajectory runs, from the state that the event names; the present speed stands beside."""

    async def body(rig: Rig) -> None:
        button = "50 % of the planned speed"
        assert not rig.find(button).enabled
        assert "data-moves" in rig.find(button).props
        rig.service.show(activity=Activity("spiral", 0.42, paused=False, pausable=True), speed_percent=100.0)
        await rig.look()
        assert rig.shows("runs at 100 %")
        SHOWN.set(7)
        await rig.click(button)
        await rig.click("150 % of the planned speed")
        assert [call for call in rig.service.calls if call[0] == "speed"] == [
            ("speed", rig.user.tab_id, 50),
            ("speed", rig.user.tab_id, 150),
        ]
        assert rig.service.asked_from == [7, 7]
        rig.service.show(speed_percent=50.0)
        await rig.look()
        assert rig.shows("runs at 50 %")
        rig.service.show(activity=Activity("home", 0.5, paused=False, pausable=False), speed_percent=None)
        await rig.look()
        assert not rig.find(button).enabled
        assert not rig.shows("runs at")

    on_page(body)


def by_socket(event: str, *message: Any) -> Any:
    """Let a message come by a socket that is no page's."""
    return core.sio.handlers["/"][event]("a socket", *message)


def test_a_stop_comes_by_the_socket_and_by_a_request_with_the_name_of_its_press(on_page: OnPage) -> None:
    async def body(rig: Rig) -> None:
        assert by_socket("emergency_stop", "x" * 1000) == {"told": True}
        assert by_socket("stop") == {"told": True}
        assert await rig.press("emergency_stop", "y" * 1000) == {"told": True}
        rig.service.show(connected=False, why_not="gone")
        assert await rig.press("stop", "z") == {"told": False}
        assert rig.service.calls == [
            ("emergency_stop", "a browser", "x" * 64),
            ("stop", "a browser", None),
            ("emergency_stop", "browser 1", "y" * 64),
            ("stop", "browser 1", "z"),
        ]

    on_page(body)


def test_each_event_names_the_state_that_its_page_had_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    handled: list[tuple[str, Any, int | None]] = []

    def handle(sid: str, message: Any) -> None:
        handled.append((sid, message, SHOWN.get()))

    monkeypatch.setitem(core.sio.handlers["/"], "event", handle)
    note_shown()
    note_shown()  # once is enough
    for shown in (7, None, "8", True, 1.5):
        by_socket("event", {"id": 3, "shown": shown})
    by_socket("event", {"id": 4})
    junk: list[Any] = [None, 5, "text", []]
    for each in junk:
        by_socket("event", each)
    assert handled == [
        ("a socket", {"id": 3}, 7),
        *[("a socket", {"id": 3}, None)] * 4,
        ("a socket", {"id": 4}, None),
    ]


def test_commands_are_asked_for_from_the_state_that_the_event_names(on_page: OnPage) -> None:
    async def body(rig: Rig) -> None:
        for shown in (5, None):
            SHOWN.set(shown)
            await rig.click("home th2")
            await rig.emit("jog_beat", press=1, what="d1", sign=1)
        rig.service.show(activity=Activity("spiral", 0.42, paused=True, pausable=True))
        await rig.look()
        SHOWN.set(6)
        await rig.click("Resume")
        assert rig.service.asked_from == [5, 5, None, None, 6]

    on_page(body)


def test_events_stay_until_they_are_cleared(on_page: OnPage) -> None:
    async def body(rig: Rig) -> None:
        rig.service.events.info("all drives: enabled")
        rig.service.events.error("th2: it has reached a limit switch")
        await rig.look()
        (log,) = [element for element in rig.elements() if element.props.get("role") == "log"]
        newest, older = [row.default_slot.children[-1] for row in log.default_slot.children[:2]]
        assert _names(newest) >= {"th2: it has reached a limit switch"}
        assert rig.user.notify.messages == ["th2: it has reached a limit switch"]  # the log is at the page's end
        assert _names(older) >= {"all drives: enabled"}
        toggle = rig.find("events to show", ui.toggle)
        toggle.set_value("problems")
        assert rig.shows("limit switch")
        assert not rig.shows("all drives: enabled")
        toggle.set_value("all")
        assert rig.shows("all drives: enabled")
        await rig.click("Clear")
        assert not any("limit switch" in text for text in rig.texts())
        rig.service.events.info("resumed")
        await rig.look()
        assert rig.shows("resumed")

    on_page(body)


def test_the_last_minutes_are_saved_as_csv(on_page: OnPage) -> None:
    async def body(rig: Rig) -> None:
        zero = np.zeros(len(LAB.joints))
        rig.service.history.add(7.0, np.array(LAB.home), zero, zero)
        await rig.click("save the last minutes as CSV")
        saved = rig.user.download.http_responses
        await rig.until(lambda: bool(saved))
        header, row = saved[0].text.splitlines()
        assert header.startswith("t_s,d1 [mm],th2 [deg],")
        assert row.startswith(f"0.0000,{LAB.home[0]:.5f},")

    on_page(body)


def test_a_page_that_is_opened_leaves_others_their_turns(tmp_path: Path) -> None:
    """Built in one go it held the beats of a jog up for as long as half a second on a busy computer."""
    turns, taken = 0, list[int]()

    async def others() -> None:
        nonlocal turns
        while True:
            await asyncio.sleep(0)
            turns += 1

    async def body() -> None:
        hub = Hub(ScriptedService(LAB), str(tmp_path / "positions.toml"))

        async def build() -> None:
            before = turns
            await hub.build()
            taken.append(turns - before)

        async with user_simulation(root=build) as user:
            counting = asyncio.create_task(others())
            await user.open("/")
            counting.cancel()

    asyncio.run(body())
    assert taken[0] >= 10


# --- who operates


def test_one_browser_operates_and_the_others_watch(tmp_path: Path) -> None:
    service = ScriptedService(LAB)

    async def body() -> None:
        async with opened(service, tmp_path) as first:
            assert first.shows("you operate (browser 1)")
            transport = httpx.ASGITransport(core.app)
            second = Rig(User(httpx.AsyncClient(transport=transport, base_url="http://test")), first.hub, service)
            await second.user.open("/")
            await second.look()
            assert second.shows("browser 1 operates, you watch")
            await second.click("Switch off")
            assert not service.asked
            assert second.shows("browser 1 operates the machine until it gives up or its page is gone")
            assert not second.shows("Operate")
            assert await second.press("stop", "a") == {"told": True}
            assert await second.press("emergency_stop", "b") == {"told": True}
            assert service.calls == [("stop", "browser 2", "a"), ("emergency_stop", "browser 2", "b")]
            await first.click("Give up")
            assert second.shows("nobody operates")
            await second.click("Operate")
            assert second.shows("you operate (browser 2)")
            assert first.shows("browser 2 operates, you watch")
            await second.click("Switch off")
            assert isinstance(service.asked[-1][1], Disable)
            await second.click("Give up")
            assert first.shows("nobody operates")
            await first.click("Operate")
            assert first.shows("you operate (browser 1)")

    asyncio.run(body())


def test_a_reload_keeps_the_operators_place(on_page: OnPage) -> None:
    async def body(rig: Rig) -> None:
        first = rig.user.client
        assert first
        await rig.user.open("/")  # the same tab
        await rig.look()
        first.delete()
        assert ("gone", rig.user.tab_id) not in rig.service.calls
        assert rig.shows("you operate (browser 1)")
        assert rig.user.client
        rig.user.client.delete()
        assert ("gone", rig.user.tab_id) in rig.service.calls
        assert rig.service.operator.holder is None

    on_page(body)


def test_a_refusal_is_shown_and_logged(on_page: OnPage) -> None:
    async def body(rig: Rig) -> None:
        rig.service.refusal = "home: busy: spiral"
        await rig.click("home th2")
        assert any("home: busy: spiral" in message for message in rig.user.notify.messages)
        assert rig.shows("refused to browser 1: home: busy: spiral")
        rig.service.refusal = None
        await rig.click("home th2")

    assert [command for _, command in on_page(body).asked] == [HomeJoint(joint="th2")]


# --- jog


def test_a_held_button_beats_and_is_released(on_page: OnPage) -> None:
    async def body(rig: Rig) -> None:
        assert json.loads(rig.find("jog th2 backward").props["data-jog"]) == {"what": "th2", "sign": -1}
        await rig.emit("jog_beat", press=7, what="th2", sign=-1)
        rig.find("speed of a jog", ui.toggle).set_value(100)
        await rig.emit("jog_beat", press=8, what="z", sign=1)
        await rig.emit("jog_beat", press=9, what="phi", sign=1)
        await rig.emit("jog_release", press=9)
        tab = rig.user.tab_id
        assert rig.service.beats == [
            (tab, 7, JointJog("th2", -0.2 * LAB.joint("th2").speed_max)),
            (tab, 8, ToolJog("z", 250.0)),
            (tab, 9, ToolJog("phi", 90.0)),
        ]
        assert rig.service.calls == [("release", tab, 9)]
        await rig.click("jog th2 backward")  # a click without a step chosen is no command
        assert not rig.service.asked

    on_page(body)


def test_a_six_axis_arm_is_jogged_along_and_about_its_own_axes(on_page: OnPage) -> None:
    async def body(rig: Rig) -> None:
        tab = rig.user.tab_id
        assert rig.shows("about z, deg")
        await rig.emit("jog_beat", press=1, what="rz", sign=-1)
        rig.find("axes that the tool moves along", ui.toggle).set_value(StepFrame.TOOL)
        await rig.emit("jog_beat", press=2, what="rz", sign=1)
        assert rig.service.beats == [
            (tab, 1, ToolJog("rz", -18.0, StepFrame.WORLD)),
            (tab, 2, ToolJog("rz", 18.0, StepFrame.TOOL)),
        ]
        rig.find("what a press moves", ui.toggle).set_value(10.0)
        await rig.click("jog x backward")
        assert rig.asked == [StepTool({"x": -10.0}, 20, StepFrame.TOOL)]

    on_page(body, ScriptedService(load_robot("ar4-mk3")))


def test_a_refused_jog_is_told_once_a_press(on_page: OnPage, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(visitor, "_ONCE_S", 0.0)

    async def body(rig: Rig) -> None:
        rig.service.refusal = "jog z: th2 not homed: home the machine first"
        for press in (1, 1, 1, 2):
            await rig.emit("jog_beat", press=press, what="z", sign=1)
        told = [message for message in rig.user.notify.messages if "not homed" in message]
        assert len(told) == 2

    on_page(body)


@pytest.mark.parametrize(
    "args", [{"press": "x", "what": "th2", "sign": 1}, {"press": 1, "what": "no-joint", "sign": 1}, {}]
)
def test_a_beat_that_is_none_moves_nothing(args: dict[str, Any], on_page: OnPage) -> None:
    async def body(rig: Rig) -> None:
        await rig.emit("jog_beat", **args)
        await rig.emit("jog_release", **{key: value for key, value in args.items() if key == "press"})

    assert not on_page(body).beats


def test_a_click_is_a_step_when_one_is_chosen(on_page: OnPage) -> None:
    async def body(rig: Rig) -> None:
        rig.find("what a press moves", ui.toggle).set_value(0.1)
        assert "data-jog" not in rig.find("jog th2 backward").props
        await rig.click("jog th2 backward")
        await rig.click("jog y forward")
        joint, tool = rig.asked
        assert (joint.joint, joint.distance, joint.speed_percent) == ("th2", -0.1, 20)
        assert (type(tool), tool.distances, tool.speed_percent) == (StepTool, {"y": 0.1}, 20)
        assert isinstance(joint, StepJoint)

    on_page(body)


# --- move


def test_joints_move_to_the_numbers_in_their_fields(on_page: OnPage) -> None:
    async def body(rig: Rig) -> None:
        field = rig.find("th2", ui.number)
        assert field.value == LAB.home[1]  # where it stands
        field.set_value(30.0)
        assert rig.shows("Tool there: x -546.410 mm, y 546.410 mm, z 0.000 mm, phi 150.000 deg")
        await rig.click("Move")
        assert rig.asked[-1].joints == {**dict(zip(LAB.joint_names, LAB.home, strict=True)), "th2": 30.0}
        assert rig.asked[-1].speed_percent == 30.0
        count = len(rig.asked)
        field.set_value(1000.0)
        assert not rig.shows("Tool there")
        await rig.click("Move")
        assert len(rig.asked) == count
        assert rig.shows(f"th2: 1000 does not fit; it takes {LAB.joint('th2').lower:g} to ")
        assert isinstance(rig.asked[-1], MoveJoints)
        field.set_value(30.0)
        rig.first("speed").set_value(None)
        await rig.click("Move")
        assert len(rig.asked) == count
        assert rig.shows("speed: there is no number; it takes 1 to 100 %")

    on_page(body)


def test_every_way_to_a_pose_is_shown_and_one_out_of_reach_says_why(on_page: OnPage) -> None:
    async def body(rig: Rig) -> None:
        pose = {"x": -300.0, "y": 400.0, "z": 0.0, "phi": 0.0}
        rig.find("kind of move", ui.toggle).set_value("tool")
        for name, value in pose.items():
            rig.first(name).set_value(value)
        assert rig.shows("right")
        assert rig.shows("left")
        await rig.trigger(rig.branch("left"), "click")
        await rig.click("Move")
        (move,) = rig.asked
        assert isinstance(move, MoveTool)
        assert (move.position.branch, dict(move.position.coordinates)) == ("left", pose)
        rig.first("x").set_value(5000.0)
        assert "branch off" in " ".join(rig.branch("left").classes)
        assert rig.shows("shoulder to wrist")
        await rig.click("Move")
        assert len(rig.asked) == 1
        assert rig.shows("no way to get there: change the pose")

    on_page(body)


def test_the_orientation_of_a_six_axis_arm_is_written_as_a_user_likes(on_page: OnPage) -> None:
    """The fields keep the pose when the notation changes; a quaternion that is none is refused where it is written."""

    async def body(rig: Rig) -> None:
        rig.find("kind of move", ui.toggle).set_value("tool")
        here = {name: rig.first(name).value for name in ("x", "y", "z", "roll", "pitch", "yaw")}
        assert here == {"x": 315.821, "y": 0.0, "z": 445.779, "roll": 180.0, "pitch": 45.0, "yaw": 180.0}
        rig.find("how the orientation is written", ui.toggle).set_value("quaternion_xyzw")
        turn = [abs(rig.first(name).value) for name in ("qx", "qy", "qz", "qw")]
        assert turn == pytest.approx([0.0, 0.92388, 0.0, 0.382683], abs=2e-6)
        assert rig.shows("front-up-noflip")
        rig.first("qw").set_value(2.0)
        assert rig.shows("quaternion_xyzw: has the length")
        await rig.click("Move")
        assert not rig.asked
        rig.first("qw").set_value(0.382683)
        await rig.click("Move")
        (move,) = rig.asked
        assert isinstance(move, MoveTool)
        assert move.position.orientation is not None
        assert (move.position.orientation.key, move.position.coordinates["x"]) == ("quaternion_xyzw", 315.821)
        rig.find("how the orientation is written", ui.toggle).set_value("abc_deg")
        assert rig.first("abc_b").value == pytest.approx(45.0, abs=1e-3)

    on_page(body, ScriptedService(load_robot("ar4-mk3")))


def test_positions_are_saved_gone_to_and_deleted(on_page: OnPage, tmp_path: Path) -> None:
    async def body(rig: Rig) -> None:
        rig.find("kind of move", ui.toggle).set_value("saved")
        assert rig.shows("No position is saved yet.")
        rig.find("name", ui.input).set_value("pick")
        await rig.click("Save present position")
        await rig.click("go to pick")
        assert isinstance(rig.asked[-1], MoveJoints)
        rig.find("name", ui.input).set_value("pick")
        await rig.click("Save present position")
        assert rig.shows("pick is saved already: delete it first")
        rig.find("name", ui.input).set_value("no name")
        await rig.click("Save present position")
        assert rig.shows("is not a position's name")
        rig.service.show_joints(homed=False)
        rig.find("name", ui.input).set_value("lost")
        await rig.click("Save present position")
        assert rig.shows("nothing to save: not every joint is homed")
        await rig.click("delete pick")
        assert rig.shows("No position is saved yet.")

    on_page(body)
    assert "pick" not in (tmp_path / "positions.toml").read_text()


# --- run


def test_a_job_is_looked_at_before_it_can_be_run(on_page: OnPage) -> None:
    async def body(rig: Rig) -> None:
        assert not rig.find("Run").enabled
        await rig.click("Preview")
        await rig.until(lambda: rig.find("Run").enabled)
        assert rig.shows("It keeps all limits")
        rig.find("repetitions", ui.number).set_value(3)
        await rig.click("Run")
        (command,) = rig.asked
        assert isinstance(command, RunMotion)
        assert (command.name, command.repeat, command.approach) == ("spiral", 3, True)
        assert command.plan.motion.duration_s == pytest.approx(18.8)
        rig.find("tool's angle psi", ui.number).set_value(10.0)  # another motion than the one that was seen
        assert not rig.find("Run").enabled

    on_page(body)


def test_the_form_has_the_jobs_own_options(on_page: OnPage) -> None:
    async def body(rig: Rig) -> None:
        assert rig.find("law of the rise", ui.select).options == ["A", "B"]
        assert rig.find("time per point", ui.number).value == 0.05
        point = rig.find("time per point", ui.number)
        point.set_value(0.0001)
        await rig.click("Preview")
        assert rig.shows("time per point: 0.0001 does not fit; it takes 0.001 to 10 s")
        point.set_value(0.001)
        await rig.click("Preview")
        await rig.until(lambda: rig.shows("times slower passes"))
        assert not rig.find("Run").enabled

    on_page(body)


FILE = "t,d1,th2,th3,th4\n0,100,0,0,0\n2,120,10,10,10\n"


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("good.csv", FILE, "It keeps all limits"),
        ("far.csv", FILE.replace("120", "12000"), "far.csv: "),
        ("bad.csv", "t,d1\n0,1\n", "bad.csv: "),
        ("bad.toml", "robot = 1", "bad.toml: "),
        ("../../evil.csv", "x", "evil.csv: "),
        ("evil.exe", FILE, "evil.exe: a file to run ends in .csv, .json, .yaml, .yml, .toml, .gcode, .nc, .ngc"),
    ],
)
def test_an_uploaded_file_passes_the_same_checks(name: str, content: str, words: str, on_page: OnPage) -> None:
    async def body(rig: Rig) -> None:
        rig.find("motion", ui.select).set_value("a file of yours")
        await rig.click("Preview")
        assert rig.shows("choose a file first")
        upload = rig.find("choose or drop files: .csv, .json, .yaml, .yml, .toml, .gcode, .nc, .ngc", ui.upload)
        await upload.handle_uploads([ui.upload.SmallFileUpload(name, "text/plain", content.encode())])
        await rig.until(lambda: rig.shows(words))
        assert rig.find("Run").enabled == (name == "good.csv")
        assert not rig.shows("/tmp")

    on_page(body)


def test_the_planned_path_is_the_same_in_every_browser_and_a_watchers_preview_is_its_own(tmp_path: Path) -> None:
    service = ScriptedService(LAB)

    async def body() -> None:
        async with opened(service, tmp_path) as first:
            transport = httpx.ASGITransport(core.app)
            second = Rig(User(httpx.AsyncClient(transport=transport, base_url="http://test")), first.hub, service)
            await second.user.open("/")
            await second.look()
            await second.click("Preview")
            await second.until(lambda: second.find("Run").enabled)
            assert service.drawing.path_mm.size == 0
            await first.click("Preview")
            await first.until(lambda: first.find("Run").enabled)
            assert service.drawing.path_mm.shape == (600, 3)
            service.drawing.follow(service.now.pose)
            await first.click("Run")
            assert service.drawing.trace_mm.size == 0  # of this run alone
            first.find("tool's angle psi", ui.number).set_value(10.0)
            assert service.drawing.path_mm.shape == (600, 3)  # it runs
            await first.click("Preview")
            await first.until(lambda: first.find("Run").enabled)
            first.find("tool's angle psi", ui.number).set_value(20.0)
            assert service.drawing.path_mm.size == 0  # of a motion that nobody wants any more

    asyncio.run(body())


def test_a_verdict_goes_with_its_motion_and_comes_back_after_a_reload(on_page: OnPage) -> None:
    async def body(rig: Rig) -> None:
        rig.find("tool's angle psi", ui.number).set_value(10.0)
        rig.find("repetitions", ui.number).set_value(3)
        await rig.click("Preview")
        await rig.until(lambda: rig.shows("It keeps all limits"))
        await rig.user.open("/")  # the same tab
        await rig.look()
        assert rig.shows("It keeps all limits")
        assert rig.find("Run").enabled
        assert rig.find("repetitions", ui.number).value == 3
        assert rig.find("tool's angle psi", ui.number).value == 10.0
        rig.find("motion", ui.select).set_value("a file of yours")
        assert not rig.shows("It keeps all limits")
        assert not rig.find("Run").enabled

    on_page(body)


def test_a_file_in_radians_is_questioned_and_can_be_read_so(on_page: OnPage) -> None:
    content = b"t,d1,th2,th3,th4\n0,100,0,0,0\n3,100,0.5,0,0\n"

    async def body(rig: Rig) -> None:
        rig.find("motion", ui.select).set_value("a file of yours")
        upload = rig.find("choose or drop files: .csv, .json, .yaml, .yml, .toml, .gcode, .nc, .ngc", ui.upload)
        await upload.handle_uploads([ui.upload.SmallFileUpload("rad.csv", "text/plain", content)])
        await rig.until(lambda: rig.shows("“radians, mm” fits, too: angles are then 57.3 times as large"))
        rig.find("units of a trajectory file", ui.toggle).set_value("rad")
        assert not rig.find("Run").enabled
        await rig.click("Preview")
        await rig.until(lambda: rig.find("Run").enabled)
        assert not rig.shows("fits, too")
        await rig.click("Run")
        assert rig.asked[-1].plan.motion.positions(np.array([3.0]))[0, 1] == pytest.approx(28.6479, abs=1e-4)

    on_page(body)


def test_another_file_replaces_the_one_before_and_it_can_be_taken_away(on_page: OnPage) -> None:
    async def body(rig: Rig) -> None:
        rig.find("motion", ui.select).set_value("a file of yours")
        upload = rig.find("choose or drop files: .csv, .json, .yaml, .yml, .toml, .gcode, .nc, .ngc", ui.upload)
        for name, content in (("bad.csv", "t,d1\n0,1\n"), ("good.csv", FILE)):
            await upload.handle_uploads([ui.upload.SmallFileUpload(name, "text/plain", content.encode())])
            await rig.until(lambda: rig.shows("bad.csv: ") if name == "bad.csv" else rig.find("Run").enabled)  # noqa: B023
        assert rig.shows(f"Chosen: good.csv, {len(FILE)} bytes")
        assert not any("bad.csv" in text for text in rig.texts())
        await rig.click("take the file away")
        assert not rig.shows("Chosen: good.csv")
        assert not rig.find("Run").enabled

    on_page(body)


TYPED: dict[str, float | None] = {
    **{"1,5": 1.5, "1.5": 1.5, " -2 ": -2.0, ",5": 0.5, "1e2": 100.0},
    **dict.fromkeys(("1,5,0", "1.000,5", "1_0", "nan", "inf", "five", "", "-")),
}


def test_a_number_may_have_a_decimal_comma_and_what_is_none_is_no_value(on_page: OnPage) -> None:
    async def body(rig: Rig) -> None:
        field = rig.find("th2", ui.number)
        for typed, value in TYPED.items():
            await rig.trigger(field, "update:modelValue", typed)
            assert field.value == value, typed

    on_page(body)


def test_errors_look_like_errors_and_buttons_without_work_ask_for_nothing(on_page: OnPage) -> None:
    async def body(rig: Rig) -> None:
        assert not rig.find("Switch on").enabled  # the drives are
        assert rig.find("Switch off").enabled
        rig.service.show_joints(state="off")
        await rig.look()
        assert rig.find("Switch on").enabled
        assert not rig.find("Switch off").enabled
        rig.service.show(emergency_stopped=True)
        await rig.look()
        assert not rig.find("Switch on").enabled  # before the reset
        rig.service.show(emergency_stopped=False)
        await rig.click("Preview")
        await rig.until(lambda: rig.find("Run").enabled)
        rig.service.show(activity=Activity("home", 0.5, paused=False, pausable=False))
        await rig.look()
        assert not rig.find("Run").enabled
        assert not rig.find("Move").enabled
        rig.service.show(activity=None)
        await rig.look()
        assert rig.find("Run").enabled
        assert rig.find("Move").enabled
        rig.service.over = "the page has fallen silent: press the button again"
        await rig.emit("jog_release", press=3)
        assert rig.user.notify.messages == [rig.service.over]

    on_page(body)


# --- outputs, settings, results


def test_outputs_are_switched_and_inputs_shown(on_page: OnPage) -> None:
    robot = load_robot("warehouse-scara")

    async def body(rig: Rig) -> None:
        await rig.click("switch magnet on")
        (command,) = rig.asked
        assert isinstance(command, SwitchOutput)
        assert (command.output, command.on) == ("magnet", True)
        before = rig.texts().count("on")
        rig.service.show(outputs=dict.fromkeys(robot.outputs, True))
        await rig.look()
        assert rig.texts().count("on") == before + len(robot.outputs)

    on_page(body, ScriptedService(robot))


def test_only_changed_settings_are_written(on_page: OnPage) -> None:
    service = ScriptedService(LAB)
    service.limits.settings = (
        Setting("th2.speed_max", "th2", "Highest speed", "deg/s", 60.0, 1.0, 90.0, (), stored=False),
        Setting("idle", None, "Current at rest", "%", 50.0, 20.0, 100.0, (20.0, 50.0, 100.0), stored=True),
    )

    async def body(rig: Rig) -> None:
        assert not rig.find("Write what has changed").enabled
        assert rig.shows("Dimensions, which only the robot's file sets: a2_mm 400, a3_mm 400, d5_mm 150.")
        rig.find("Highest speed", ui.number).set_value(200.0)
        await rig.click("Write what has changed")
        assert not rig.asked
        assert rig.shows("th2: Highest speed: 200 does not fit; it takes 1 to 90 deg/s")
        rig.find("Highest speed", ui.number).set_value(60.0)
        assert not rig.find("Write what has changed").enabled  # as it was
        rig.find("Highest speed", ui.number).set_value(45.0)
        rig.find("* Current at rest", ui.select).set_value(20.0)
        await rig.click("Write what has changed")
        (command,) = rig.asked
        assert isinstance(command, WriteSettings)
        assert command.values == {"th2.speed_max": 45.0, "idle": 20.0}

    on_page(body, service)


def test_a_run_that_has_ended_shows_its_verdict(on_page: OnPage) -> None:
    stopped = Result(1, 0.0, "spiral", None, "stopped by an operator", None)

    async def body(rig: Rig) -> None:
        assert rig.shows("No run has ended yet.")
        rig.service.kept_results = (stopped,)
        await rig.look()
        assert rig.shows("did not end")
        assert rig.shows("stopped by an operator")
        rig.service.kept_results = (stopped, replace(stopped, number=2, passed=False, why=None))
        await rig.look()
        assert rig.shows("ended elsewhere")
        await rig.click("show run 1")
        assert rig.shows("spiral, run 1")

    on_page(body)


def test_the_pictures_of_a_run_show_its_end_and_its_errors_in_steps(on_page: OnPage) -> None:
    spiral = plan(LAB, make_job(LAB, "spiral"))
    ends = tuple(AxisEnd(name, 0, 0, 0.25) for name in LAB.joint_names)
    outcome = LiveOutcome(spiral, "spiral", 1, ends, [], list(LAB.home), 20.0)
    errors = tuple(Placed(np.array([1.0, 18.5]), np.zeros(2), np.array([0.0, 0.25 * i])) for i in range(4))

    async def body(rig: Rig) -> None:
        rig.service.kept_results = (Result(1, 0.0, "spiral", True, None, outcome, errors),)
        await rig.look()
        positions, differences = (each.options for each in rig.elements() if isinstance(each, ui.echart))
        assert positions["series"][0]["data"][-1][0] == pytest.approx(spiral.motion.duration_s)
        assert [series["data"][-1] for series in differences["series"]] == [[18.5, 0.25 * i] for i in range(4)]
        assert rig.shows("reported minus planned, steps")

    on_page(body)


def test_a_board_that_falls_behind_is_told_of(on_page: OnPage) -> None:
    async def body(rig: Rig) -> None:
        rig.service.show(board=BoardFigures(stood_percent=4.9))
        await rig.look()
        assert not any("falls behind" in text for text in rig.texts())
        rig.service.show(board=BoardFigures(stood_percent=12.4))
        await rig.look()
        assert any("its clock stood for 12 % of the last 5 s" in text for text in rig.texts())

    on_page(body)


def test_home_all_is_offered_where_it_is_needed(on_page: OnPage) -> None:
    async def body(rig: Rig) -> None:
        await rig.click("Home all")
        assert isinstance(rig.asked[-1], HomeAll)

    on_page(body)
