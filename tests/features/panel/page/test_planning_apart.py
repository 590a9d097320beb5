"""Files planned in a process of their own: the same plans and errors as here, ended in time."""

import asyncio
import os
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from steptwin.features.panel.page import motions
from steptwin.features.panel.page.motions import UploadedMotion, path_mm, plan_apart, plan_upload
from steptwin.host.common.errors import InputError
from steptwin.host.robots import load_robot
from tests.end_to_end.pages import ROOT
from tests.messages import refusing

pytestmark = pytest.mark.live

ROBOT = load_robot("teaching-scara")
PROGRAM = (ROOT / "docs" / "programs" / "teaching-scara.toml").read_bytes()
SLOW = b'robot = "teaching-scara"\n[[step]]\ngo = { th1 = 10.0, th2 = 40.0 }\n[[step]]\nrepeat = 2400\n' + (
    b"steps = [{ by = { z = -1.0 }, speed_mm_s = 3.0 }, { by = { z = 1.0 }, speed_mm_s = 3.0 }]\n"
)
"""Some 4800 lines of the tool: they take far longer than a test waits."""


def children() -> set[str]:
    """Return the processes that plan for this one."""
    tasks = Path(f"/proc/{os.getpid()}/task").glob("*/children")
    return {child for task in tasks for child in task.read_text().split()}


@pytest.mark.slow
def test_the_plan_and_its_errors_are_those_of_this_process() -> None:
    parts = UploadedMotion(ROBOT, "parts.toml", PROGRAM, 2.0)
    apart, asked = asyncio.run(plan_apart(parts))
    here, asked_here = plan_upload(parts)
    assert asked == asked_here
    assert np.array_equal(apart.points_units, here.points_units)
    assert np.array_equal(apart.velocities, here.velocities)
    assert (apart.peaks, apart.motion.duration_s) == (here.peaks, here.motion.duration_s)
    long = UploadedMotion(ROBOT, "long.csv", b"t,th1,th2,d3,th4\n0,0,0,0,0\n0.1,90,0,0,0\n", 1.0)
    with pytest.raises(InputError) as told_here:
        plan_upload(long)
    with pytest.raises(InputError) as told:
        asyncio.run(plan_apart(long))
    assert (str(told.value), told.value.plain) == (str(told_here.value), told_here.value.plain)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ar4-mk3", "corexy-gantry", "turntable"])
def test_what_is_planned_apart_has_a_path_here(name: str) -> None:
    """The tool's task of another process is the one of this: of six axes nothing was shown."""
    robot = load_robot(name)
    program = (ROOT / "docs" / "programs" / f"{name}.toml").read_bytes()
    file = UploadedMotion(robot, f"{name}.toml", program, 1.0)
    apart, _ = asyncio.run(plan_apart(file))
    here, _ = plan_upload(file)
    assert np.array_equal(path_mm(apart), path_mm(here))


def test_it_ends_with_the_task_that_waits_for_it() -> None:
    before = children()

    async def begun_and_cancelled() -> None:
        task = asyncio.create_task(plan_apart(UploadedMotion(ROBOT, "slow.toml", SLOW, 1.0)))
        while children() == before:
            await asyncio.sleep(0.01)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task

    asyncio.run(begun_and_cancelled())
    assert children() == before


def test_it_ends_after_its_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(motions, "PLANNING_S_MAX", 0.5)
    before = children()
    with refusing(InputError):
        asyncio.run(plan_apart(UploadedMotion(ROBOT, "slow.toml", SLOW, 1.0)))
    assert children() == before


@pytest.mark.slow
def test_it_ends_with_the_process_that_asked() -> None:
    """The panel may be killed: then the stdin of its child ends, also in the middle of its work."""
    request = pickle.dumps(UploadedMotion(ROBOT, "slow.toml", SLOW, 1.0))
    with subprocess.Popen(
        [sys.executable, "-m", motions.__name__], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as child:
        assert child.stdin
        child.stdin.write(len(request).to_bytes(8, "little") + request)
        child.stdin.close()
        assert child.wait(60.0) == 1
