"""Ctrl-C at any instant: exit code 130, and no traceback."""

import subprocess
import sys

import pytest

from tests.emulator.live.live_rig import TIMEOUT_S

pytestmark = pytest.mark.live

PROGRAM = """
import atexit, os, signal, sys

instant = sys.argv[1]

def interrupt():
    os.kill(os.getpid(), signal.SIGINT)

class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == instant:
            interrupt()

sys.meta_path.insert(0, Finder())
if instant == "the end":
    atexit.register(interrupt)
sys.argv[1:] = ["fk", "lab-scara", "150", "0", "90", "0"]
from steptwin.__main__ import main
main()
"""


@pytest.mark.parametrize(
    "instant",
    ["steptwin.host.cli", "typer", "steptwin.host.cli.robots.poses", "numpy", "steptwin.host.robots", "the end"],
)
def test_during_an_import_and_at_the_end(instant: str) -> None:
    words = [sys.executable, "-c", PROGRAM, instant]
    done = subprocess.run(words, capture_output=True, text=True, timeout=TIMEOUT_S, check=False)
    assert (done.returncode, done.stderr) == (130, "")
    assert bool(done.stdout) == (instant == "the end")


def test_without_an_interrupt() -> None:
    words = [sys.executable, "-c", PROGRAM, "nothing"]
    done = subprocess.run(words, capture_output=True, text=True, timeout=TIMEOUT_S, check=False)
    assert (done.returncode, done.stderr) == (0, "")
