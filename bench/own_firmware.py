"""Measure the example of a user's firmware: what a call costs, and a job's motion made by it."""

import ctypes
import shutil
import struct
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any, Final, NamedTuple
from unittest.mock import patch

import numpy as np
from rich.table import Table

from steptwin.bench import bench_table
from steptwin.features.firmware.library import NativeLibrary
from steptwin.features.firmware.options import FirmwareOptions
from steptwin.features.firmware.process import FirmwareProcess, interface_files
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot
from steptwin.host.twin.board_under_test import BoardUnderTest
from steptwin.protocol.frame import FIRST_NODE_ID

_ROBOT: Final = load_robot("teaching-scara")
_PLAN: Final = plan(_ROBOT, make_job(_ROBOT, "carry", {}))
_SET_POINTS_MS: Final = (20, 5, 1)
_QUEUED: Final = 4
"""Set-points ahead of the motion; the example keeps eight."""
_SETTLING_S: Final = 0.1
_CALLS: Final = 100_000
_REPEATS: Final = 5


def firmware_tables() -> Iterator[Table | str]:
    """Yield the tables, or why there are none."""
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        yield "No own firmware: no C compiler is installed"
        return
    with TemporaryDirectory() as folder:
        built = _built(compiler, Path(folder))
        yield bench_table(f"Own firmware: one call of the example, median of {_REPEATS}", "call|us", _call_rows(built))
        yield bench_table(
            f"Own firmware: the example makes teaching-scara's carry, {_PLAN.motion.duration_s:g} s; median of"
            f" {_REPEATS}",
            "set-points each|s|x real time|calls|us a call|s in the library alone",
            (_carry_row(built, each_ms) for each_ms in _SET_POINTS_MS),
        )


def _built(compiler: str, folder: Path) -> Path:
    """Compile the example as docs/firmware.md does."""
    for name, text in interface_files().items():
        (folder / name).write_text(text, encoding="utf-8")
    library = folder / "fw.so"
    sources = (str(folder / name) for name in ("example.c", "steptwin_hal.c"))
    subprocess.run([compiler, "-O2", "-shared", "-fPIC", "-o", str(library), *sources], check=True)
    return library


class _Loaded:
    """A library in this process, from a copy of its file: its global variables are new."""

    def __init__(self, built: Path, copy: str) -> None:
        path = built.with_name(copy)
        shutil.copy(built, path)
        self.library = NativeLibrary(str(path))
        self.calls = {
            each.__name__: each
            for each in (self.library.boot, self.library.receive, self.library.inputs, self.library.run)
        }


def _call_rows(built: Path) -> Iterator[str]:
    loaded = _Loaded(built, "called.so")
    loaded.library.boot(4, FIRST_NODE_ID, b"", 0)
    yield f"st_next_due, which does nothing, by ctypes|{_each_us(ctypes.CDLL(str(built)).st_next_due):.2f}"
    yield f"`run` without time: st_run, edges, frames, st_next_due|{_each_us(lambda: loaded.library.run(0, 0)):.2f}"
    process = FirmwareProcess(built)
    process.call("boot", 4, FIRST_NODE_ID, b"", 0)
    yield f"the same in a process of its own|{_each_us(lambda: process.call('run', 0, 0), _CALLS // 10):.1f}"
    process.close()


def _each_us(call: Any, count: int = _CALLS) -> float:
    """Return the time of one call."""
    took_s = []
    for _ in range(_REPEATS):
        began_s = time.perf_counter()
        for _ in range(count):
            call()
        took_s.append(time.perf_counter() - began_s)
    return 1e6 * median(took_s) / count


class _Carried(NamedTuple):
    """A motion that was made: its wall time without starting the process, and what was asked of the library."""

    wall_s: float
    asked: list[tuple[Any, ...]]


def _carried(built: Path, each_ms: int) -> _Carried:
    """Let the example make the motion by set-points."""
    board = BoardUnderTest(_ROBOT, extras=[FirmwareOptions(firmware=built)], stand_at=_PLAN.start_joints)
    nodes = [FIRST_NODE_ID + axis for axis in range(len(_ROBOT.axes))]
    for node in nodes:
        board.network.send_message(0x280 + node, b"\x01")
    board.wait(_SETTLING_S)
    ends_s = np.arange(0, round(_PLAN.motion.duration_s * 1000) // each_ms + 1) * each_ms / 1000
    steps = np.rint(_PLAN.motion.positions(ends_s) * _ROBOT.steps_per_unit).astype(np.int64)
    targets = [struct.pack("<iH", target, each_ms) for target in (steps[1:] - steps[0]).ravel().tolist()]
    asked, call = list[tuple[Any, ...]](), FirmwareProcess.call

    def noting(process: FirmwareProcess, *words: Any) -> Any:
        asked.append(words)
        return call(process, *words)

    with patch.object(FirmwareProcess, "call", noting):
        wall_s = _streamed(board, nodes, targets, each_ms / 1000)
    assert [board.steps()[name] for name in _ROBOT.joint_names] == steps[-1].tolist()
    return _Carried(wall_s, asked)


def _streamed(board: BoardUnderTest, nodes: list[int], targets: list[bytes], each_s: float) -> float:
    """Send the set-points as they are due, and wait for the last; return the wall time."""
    began_s, begin_s = time.perf_counter(), board.now_s()
    for number in range(len(targets) // len(nodes)):
        for axis, node in enumerate(nodes):
            board.network.send_message(0x200 + node, targets[number * len(nodes) + axis])
        ahead_s = begin_s + (number - _QUEUED) * each_s - board.now_s()
        if ahead_s > 0.0:
            board.wait(ahead_s)
    board.wait(begin_s + _PLAN.motion.duration_s + _SETTLING_S - board.now_s())
    return time.perf_counter() - began_s


def _carry_row(built: Path, each_ms: int) -> str:
    runs = [_carried(built, each_ms) for _ in range(_REPEATS)]
    wall_s, asked = median(run.wall_s for run in runs), runs[0].asked
    loaded = _Loaded(built, f"alone{each_ms}.so")
    loaded.library.boot(len(_ROBOT.axes), FIRST_NODE_ID, b"", 0)
    for node in range(FIRST_NODE_ID, FIRST_NODE_ID + len(_ROBOT.axes)):
        loaded.library.receive(struct.pack("<IB3x8s", 0x280 + node, 1, b"\x01"), 0)
    began_s = time.perf_counter()
    for name, *arguments in asked:
        loaded.calls[name](*arguments)
    alone_s = time.perf_counter() - began_s
    rate, call_us = (_PLAN.motion.duration_s + _SETTLING_S) / wall_s, 1e6 * wall_s / len(asked)
    return f"{each_ms} ms|{wall_s:.2f}|{rate:.1f}|{len(asked)}|{call_us:.0f}|{alone_s:.3f}"
