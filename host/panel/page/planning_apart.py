"""Plan an uploaded file in a process of its own: it can be ended, and its memory goes with it.

The page's process stays as it was, whatever is in the file. The process ends when its task is cancelled, when it takes
too long or too much memory, and with the page's process: its stdin then ends.

`python -m steptwin.host.panel.page.planning_apart` is that process: it reads the arguments of `plan_upload` from stdin
and writes the plan, or the error, to stdout, both pickled; they come from this program alone.
"""

import asyncio
import os
import pickle
import sys
from asyncio.subprocess import PIPE
from contextlib import suppress
from threading import Thread
from typing import Final

from steptwin.host.common.errors import InputError, StepTwinError
from steptwin.host.panel.page.motions import USUAL_UNITS, plan_upload
from steptwin.host.planning.plan import Plan
from steptwin.host.robots.robot import Robot

PLANNING_S_MAX: Final = 120.0
"""Longest time for planning a file: a straight line of the tool that lasts an hour takes some 10 s."""
MEMORY_BYTES_MAX: Final = 3 << 30
"""Addresses that the process may use; an hour takes some 150 MiB of memory, and libraries reserve far more."""
_SIZE_BYTES: Final = 8


Planned = tuple[Plan, str | None]
"""A plan, and what is to be asked about the units of its file, if that is doubtful."""


async def plan_apart(
    robot: Robot, name: str, content: bytes, stretch: float | None, units: str = USUAL_UNITS
) -> Planned:
    """Plan an uploaded file as `plan_upload`; raise InputError as it does, or if it takes too long or too much."""
    request = pickle.dumps((robot, name, content, stretch, units))
    process = await asyncio.create_subprocess_exec(sys.executable, "-m", __name__, stdin=PIPE, stdout=PIPE)
    assert process.stdin
    assert process.stdout
    try:
        with suppress(ConnectionError):
            process.stdin.write(len(request).to_bytes(_SIZE_BYTES, "little") + request)
            await process.stdin.drain()
        answer = await asyncio.wait_for(process.stdout.read(), PLANNING_S_MAX)
    except TimeoutError:
        raise InputError(f"{name}: planning it takes more than {PLANNING_S_MAX:g} s, so it was ended") from None
    finally:
        with suppress(ProcessLookupError):
            process.kill()
        await process.wait()
    if not answer:
        raise InputError(f"{name}: the process that planned it has ended without an answer")
    planned: Planned | StepTwinError = pickle.loads(answer)
    if isinstance(planned, StepTwinError):
        raise planned
    return planned


def _answer(robot: Robot, name: str, content: bytes, stretch: float | None, units: str) -> Planned | StepTwinError:
    try:
        return plan_upload(robot, name, content, stretch, units)
    except StepTwinError as error:
        return error
    except MemoryError:
        return InputError(f"{name}: planning it takes more memory than it may")


def _limit_memory() -> None:
    """Limit this process' addresses, where the system can."""
    with suppress(ImportError):
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES_MAX, MEMORY_BYTES_MAX))


def _end_with_parent() -> None:
    """End this process as soon as its stdin has ended."""
    while os.read(sys.stdin.fileno(), 1):
        pass
    os._exit(1)


def main() -> None:
    """Plan what stdin asks for."""
    _limit_memory()
    size = int.from_bytes(sys.stdin.buffer.read(_SIZE_BYTES), "little")
    request = pickle.loads(sys.stdin.buffer.read(size))
    Thread(target=_end_with_parent, daemon=True).start()
    sys.stdout.buffer.write(pickle.dumps(_answer(*request)))
    sys.stdout.buffer.flush()
    os._exit(0)


if __name__ == "__main__":
    main()
