"""Motions of the Run tab, planned and checked as on the command line: jobs, trajectory files, programs.

An uploaded file is planned in a process of its own, which can be ended and takes its memory with it. Whatever the file
holds, the page's process is unaffected. The process ends when its task is cancelled, when it takes too much time or
memory, and with the page's process: its stdin then ends.

`python -m steptwin.features.panel.page.motions` is that process: it reads an `UploadedMotion` from stdin and writes the
plan, or the error, to stdout, both pickled; only this program writes them.
"""

import asyncio
import os
import pickle
import re
import sys
from asyncio.subprocess import PIPE
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from threading import Thread
from typing import Final

import numpy as np

from steptwin.features.panel.page.uploads import uploaded
from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError, StepTwinError
from steptwin.host.planning.drives import known_drives
from steptwin.host.planning.jobs import job_fields, make_job
from steptwin.host.planning.jobs.options import OptionField
from steptwin.host.planning.motion import Motion
from steptwin.host.planning.plan import Plan
from steptwin.host.planning.planner import plan, plan_stretched
from steptwin.host.planning.programs import SUFFIX, compile_program, read_program
from steptwin.host.planning.trajectory_file import doubt, read_file_motion
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.kinematics.base import tool_places_mm
from steptwin.host.robots.robot import Robot

TITLES: Final[dict[str, str]] = {
    "approach_mm": "length of the approach",
    "depth_mm": "depth of the grip",
    "elbow": "elbow's side",
    "from": "first point",
    "law": "law of time",
    "mm_per_rad": "growth of the radius",
    "pause_s": "pause at each point",
    "point_s": "time per point",
    "psi_deg": "tool's angle psi",
    "pull_s": "time of a pull",
    "ramp_s": "time to speed up",
    "repetitions": "cycles in one run",
    "rise_mm": "rise per turn",
    "sensors": "shelf's sensors",
    "to": "second point",
    "travel_mm": "length of the pull",
    "x_mm": "centre x",
    "y_mm": "centre y",
    "z_law": "law of the rise",
    "z_mm": "height of the start",
}
"""Title of each option by name."""


def option_title(field: OptionField) -> str:
    """Return the title of an option; by default its name without the unit."""
    if field.name in TITLES:
        return TITLES[field.name]
    unit = "" if field.allowed is None else field.allowed.unit
    return field.name.replace("_", " ").removesuffix(f" {unit}")


@contextmanager
def naming_titles(fields: Iterable[OptionField]) -> Iterator[None]:
    """Replace option names in errors of the block by the form's titles."""
    titles = {field.name: option_title(field) for field in fields if "_" in field.name}
    try:
        yield
    except InputError as error:
        names = re.compile(rf"\b({'|'.join(titles)})\b")
        plain = names.sub(lambda found: f'"{titles[found[1]]}"', error.plain) if titles else error.plain
        raise InputError(*error.messages).plainly(plain) from error


USUAL_UNITS: Final = "deg,mm"
UNITS: Final = {
    USUAL_UNITS: "degrees, mm",
    "rad": "radians, mm",
    "m": "degrees, m",
    "rad,m": "radians, m",
}
"""Titles of the units of trajectory files."""
_PATH_POINTS: Final = 600
"""Points of a displayed path: enough for the resolution of a screen."""


def plan_job(robot: Robot, name: str, options: Mapping[str, str], stretch: float | None) -> Plan:
    """Plan a job with options as texts; `stretch` as in `plan_stretched`. Raises InputError."""
    with naming_titles(job_fields(robot, name)):
        return _planned(robot, make_job(robot, name, options), stretch)


@dataclass(frozen=True, slots=True)
class UploadedMotion:
    """An uploaded file with a motion, and how to plan it.

    Attributes:
        robot: the machine.
        name: the file's name.
        content: content of the file.
        stretch: as in `plan_stretched`.
        units: units of a trajectory file.
        beside: other uploaded files by name, to which a program may refer. No other file is read: the robot that a
            program names is the machine's own if the names agree.
    """

    robot: Robot
    name: str
    content: bytes
    stretch: float | None
    units: str = USUAL_UNITS
    beside: Mapping[str, bytes] = field(default_factory=dict)


Planned = tuple[Plan, str | None]
"""A plan, and a question about the units of its file if it hardly moves."""


def plan_upload(file: UploadedMotion) -> Planned:
    """Plan an uploaded file; raise InputError, with the file's own name, for errors in it."""
    robot, stretch = file.robot, file.stretch
    with uploaded(file.name, file.content, file.beside, robot) as path:
        if path.endswith(SUFFIX):
            program = compile_program(read_program(path), robot, drives=known_drives())
            with program.explained(stretch or 1.0):
                return _planned(robot, program.motion, stretch), None
        motion = read_file_motion(path, robot, units=file.units)
        with motion.explained(stretch or 1.0):
            planned = _planned(robot, motion.whole, stretch)
        if file.units != USUAL_UNITS:
            return planned, None
        doubted = doubt(motion, planned, lambda other: read_file_motion(path, robot, units=other))
    for units, title in reversed(UNITS.items()):  # as the Run tab names them
        doubted = doubted and doubted.replace(f"units={units} fits", f"“{title}” fits")
    return planned, doubted


def path_mm(plan: Plan) -> FloatArray:
    """Return the tool's planned path, shape (n, 3)."""
    t_s = np.linspace(0.0, plan.motion.duration_s, _PATH_POINTS)
    return tool_places_mm(make_kinematics(plan.robot), plan.motion.positions(t_s))


def _planned(robot: Robot, motion: Motion, stretch: float | None) -> Plan:
    return plan(robot, motion) if stretch == 1.0 else plan_stretched(robot, motion, stretch)


PLANNING_S_MAX: Final = 120.0
"""Longest time for planning a file: a straight line of the tool that lasts an hour takes some 10 s."""
MEMORY_BYTES_MAX: Final = 3 << 30
"""Address space of the process; an hour's motion takes some 150 MiB of memory, and libraries reserve far more."""
_SIZE_BYTES: Final = 8


async def plan_apart(file: UploadedMotion) -> Planned:
    """Plan an uploaded file as `plan_upload` in another process; raise InputError also beyond its time or memory."""
    request = pickle.dumps(file)
    process = await asyncio.create_subprocess_exec(sys.executable, "-m", __name__, stdin=PIPE, stdout=PIPE)
    assert process.stdin
    assert process.stdout
    try:
        with suppress(ConnectionError):
            process.stdin.write(len(request).to_bytes(_SIZE_BYTES, "little") + request)
            await process.stdin.drain()
        answer = await asyncio.wait_for(process.stdout.read(), PLANNING_S_MAX)
    except TimeoutError:
        raise InputError(f"{file.name}: planning it takes more than {PLANNING_S_MAX:g} s, so it was ended") from None
    finally:
        with suppress(ProcessLookupError):
            process.kill()
        await process.wait()
    if not answer:
        raise InputError(f"{file.name}: the process that planned it has ended without an answer")
    planned: Planned | StepTwinError = pickle.loads(answer)
    if isinstance(planned, StepTwinError):
        raise planned
    return planned


def _end_with_parent() -> None:
    """End this process when its stdin ends."""
    while os.read(sys.stdin.fileno(), 1):
        pass
    os._exit(1)


def main() -> None:
    """Plan the motion from stdin."""
    with suppress(ImportError):  # some systems cannot limit the address space
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES_MAX, MEMORY_BYTES_MAX))
    size = int.from_bytes(sys.stdin.buffer.read(_SIZE_BYTES), "little")
    file: UploadedMotion = pickle.loads(sys.stdin.buffer.read(size))
    Thread(target=_end_with_parent, daemon=True).start()
    answer: Planned | StepTwinError
    try:
        answer = plan_upload(file)
    except StepTwinError as error:
        answer = error
    except MemoryError:
        answer = InputError(f"{file.name}: planning it takes more memory than it may")
    sys.stdout.buffer.write(pickle.dumps(answer))
    sys.stdout.buffer.flush()
    os._exit(0)


if __name__ == "__main__":
    main()
