"""A program that waits for an input on a served board, in real time: late, too late, and at once."""

from pathlib import Path
from tempfile import mkdtemp
from threading import Timer

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.host.cli.app import run
from steptwin.host.robots import load_robot
from steptwin.host.twin.live.served_board import ServedBoard
from tests.end_to_end.served import in_real_time

ROBOT = load_robot("teaching-scara")
HOME = " ".join(map(str, ROBOT.home))
PROGRAM = """
robot = "teaching-scara"
[[step]]
wait = "part_ready"
on = true
timeout_s = 4.0
[[step]]
by = { th1 = 5.0 }
[[step]]
by = { th1 = -5.0 }
"""


@in_real_time
def test_a_wait_at_the_start_of_a_program(
    fast_kernel: Kernel, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    program = Path(mkdtemp(dir=tmp_path)) / "waiting.toml"
    program.write_text(PROGRAM)
    with ServedBoard(ROBOT, port=0, kernel=fast_kernel) as served:
        there = ["--connect", f"127.0.0.1:{served.port}"]
        assert run(["home", ROBOT.name, "--here", HOME, *there]) == 0
        running = ["run", ROBOT.name, str(program), *there]
        capsys.readouterr()
        assert run(running) == 3
        (line,) = capsys.readouterr().err.splitlines()
        assert line.startswith("steptwin: step 1: the input part_ready was not on within 4 s")
        part_comes = Timer(3.0, lambda: served.set_input("part_ready", on=True))
        part_comes.start()
        assert run(running) == 0, capsys.readouterr().err
        part_comes.join()
        assert run(running) == 0, capsys.readouterr().err  # the part is there
        assert capsys.readouterr().out.count("waited: part_ready on for ") == 2
