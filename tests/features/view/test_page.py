"""The page of a replay in NiceGUI's simulation of a browser: buttons move the cursor, and everything follows it."""

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import replace

import pytest

pytest.importorskip("nicegui")

from nicegui import ui
from nicegui.testing import User, UserInteraction
from nicegui.testing.user_simulation import user_simulation

from steptwin.features.panel.page.scene import ArmScene
from steptwin.features.view.marks import MarkKind, RunMark
from steptwin.features.view.model import Replay
from steptwin.features.view.page import ReplayPage
from steptwin.host.record.folder.reading import counts_alone
from tests.host.record.machines import perfect_run
from tests.host.verify.motions import START_COUNTS

pytestmark = pytest.mark.slow

RUN = perfect_run("teaching-scara", "carry")
FAILED = replace(RUN, report=replace(RUN.report, passed=False))
MARK = RunMark(MarkKind.VIOLATION, START_COUNTS + 36_000_000, START_COUNTS + 36_000_000, "th1", "CLK too short")
Visit = Callable[[User], Awaitable[None]]


def visit(replays: tuple[Replay, ...], what: Visit) -> None:
    """Open a page of its own in a simulated browser and do something there."""

    async def run() -> None:
        async with user_simulation(root=lambda: ReplayPage(replays)) as user:
            await user.open("/")
            await what(user)

    asyncio.run(run())


def button(user: User, label: str) -> ui.button:
    """Return the button with a label for those who cannot see it."""
    (found,) = (each for each in user.find(ui.button).elements if each.props.get("aria-label") == label)
    return found


def press(user: User, label: str) -> None:
    UserInteraction(user, {button(user, label)}, None).click()


def clock(user: User) -> str:
    (label,) = (each for each in user.find(ui.label).elements if "clock" in each.classes)
    return str(label.text)


def table(user: User) -> str:
    """Return the markup of the table at the cursor."""
    (found,) = (each.content for each in user.find(ui.html).elements if "grid-table" in each.content)
    return str(found)


def test_counts_without_a_plan_are_shown_as_such() -> None:
    comparison = counts_alone(RUN.robot, RUN.comparison.evidence)
    report = replace(RUN.report, passed=None)
    replay = Replay(replace(RUN, comparison=comparison, report=report, no_plan="no trajectory was run"), [])

    async def look(user: User) -> None:
        await user.should_see("recorded live: counts without a plan")
        await user.should_not_see("planned path")
        assert "planned" not in table(user)
        press(user, "edge after")
        press(user, "edge after")
        assert f"{replay.at(replay.start_counts).joints[0].counted:.4f}" in table(user)

    visit((replay,), look)


def test_steps_and_marks_move_the_cursor_and_the_table_follows() -> None:
    replay = Replay(RUN, [MARK])
    first = replay.edge_after(START_COUNTS)
    assert first is not None

    async def steps(user: User) -> None:
        await user.should_see("teaching-scara · carry")
        await user.should_see("verified")
        assert clock(user) == "t = 0.000000 s"
        press(user, "edge after")
        assert clock(user) == f"t = {replay.time_s(first.counts):.6f} s"
        press(user, "mark after")
        assert clock(user) == "t = 0.500000 s"
        row = replay.at(MARK.counts).joints[0]
        assert f"{row.counted:.4f}" in table(user)
        assert f">{row.steps}<" in table(user)
        press(user, "mark before")
        assert clock(user) == "t = 0.500000 s"

    visit((replay,), steps)


def test_a_click_on_what_happened_goes_there() -> None:
    async def click(user: User) -> None:
        user.find("0.500000 s · th1: CLK too short").click()
        assert clock(user) == "t = 0.500000 s"

    visit((Replay(RUN, [MARK]),), click)


def test_the_slider_and_the_choice_of_an_axis() -> None:
    replay = Replay(RUN, ())

    async def slide(user: User) -> None:
        user.find(ui.slider).trigger("update:modelValue", 0.25)
        assert clock(user) == "t = 0.250000 s"
        pins = [each.content for each in user.find(ui.html).elements if "pins around" in each.content]
        assert len(pins) == 1
        assert all(f"{name} STEP" in pins[0] for name in RUN.robot.joint_names)
        await user.should_see(ArmScene)
        press(user, "play")
        assert button(user, "play").icon == "pause"
        press(user, "play")
        assert button(user, "play").icon == "play_arrow"

    visit((replay,), slide)


def test_two_runs_side_by_side() -> None:
    async def look(user: User) -> None:
        await user.should_see("not verified")
        assert all(f">{head}<" in table(user) for head in ("first", "second", "difference"))
        assert "Tools from each other: <b" in table(user)
        await user.should_see("0.500000 s · second: th1: CLK too short")

    visit((Replay(RUN, ()), Replay(FAILED, [MARK])), look)
