"""A firmware that breaks out of its interface: pipes, signals, processes and floods. Each ends with one sentence."""

import gc
import os
import select
from pathlib import Path

import pytest

from steptwin.emulator.board.board_firmware import FirmwareError
from steptwin.features.firmware.options import FirmwareOptions
from steptwin.host.common.errors import InputError
from steptwin.host.robots import load_robot
from steptwin.host.twin.board_under_test import BoardUnderTest
from tests.features.firmware.compilers import NEEDS_GCC, Build

pytestmark = NEEDS_GCC

ROBOT = load_robot("teaching-scara")
SLOW = "st_run has not returned for 0.3 s: does it loop?"
JUNK = "st_run has written into the pipe of its answers"
ASKS = "asks for more than 1000 calls and frames within 1 ms at "
WAITS = {
    1: "st_run has closed the pipes of its process",
    2: SLOW,
    7: SLOW,
    8: SLOW,
}
"""Harms whose end is a matter of real time."""
AT_ONCE = {
    3: JUNK,
    4: "st_run crashed: signal ",
    5: JUNK,
    6: JUNK,
    9: "st_run ended the process, with exit code 0",
    20: f"st_run {ASKS}",
    21: f"st_run {ASKS}",
    22: f"st_run {ASKS}",
    23: "st_take_edges says that it gives 4097, where room is for 4096",
    24: "st_take_edges gives more than 1048576 at once",
}


def complaint(library: Path) -> str:
    """What a run of a second says of the firmware, without the file's name."""
    with pytest.raises((FirmwareError, InputError)) as error:
        BoardUnderTest(ROBOT, extras=[FirmwareOptions(firmware=library)]).wait(1.0)
    said = str(error.value)
    assert "\n" not in said
    assert str(library) in said
    return said.split(f"{library}: ", 1)[1]


@pytest.mark.parametrize("harm", AT_ONCE)
def test_a_harm_ends_with_a_sentence(harm: int, build: Build) -> None:
    assert complaint(build("hostile.c", HARM=harm)).startswith(AT_ONCE[harm])


@pytest.mark.live
@pytest.mark.parametrize("harm", WAITS)
def test_a_harm_that_waits_ends_with_a_sentence(harm: int, build: Build, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("steptwin.features.firmware.process.HANGS_S", 0.3)
    monkeypatch.setattr("steptwin.features.firmware.process._ENDS_S", 0.3)
    assert complaint(build("hostile.c", HARM=harm)) == WAITS[harm]


@pytest.mark.slow
@pytest.mark.parametrize("harm", [0, 9])
def test_no_process_outlives_the_run(harm: int, build: Build, tmp_path: Path) -> None:
    """The firmware's child holds a FIFO open, whose reader is told when it ends."""
    fifo = tmp_path / "fifo"
    os.mkfifo(fifo)
    library = build("hostile.c", HARM=harm, FIFO=f'"{fifo}"')
    reader = os.open(fifo, os.O_RDONLY | os.O_NONBLOCK)
    try:
        if harm:
            assert complaint(library) == "st_run ended the process, with exit code 0"
        else:
            BoardUnderTest(ROBOT, extras=[FirmwareOptions(firmware=library)]).wait(0.1)
        gc.collect()
        ended = select.poll()
        ended.register(reader, select.POLLHUP)
        assert ended.poll(10_000)
    finally:
        os.close(reader)
