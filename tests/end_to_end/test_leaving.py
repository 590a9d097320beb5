"""A program that has done its work leaves, with all that it has printed, whatever is left in its interpreter."""

import subprocess
import sys

import pytest

from tests.emulator.live.live_rig import TIMEOUT_S

pytestmark = pytest.mark.live

PROGRAM = """
import atexit, sys, threading, time

class Holds:
    def __del__(self, sleep=time.sleep):
        sleep(3600)

sys.kept = Holds()
atexit.register(lambda: sys.stdout.write("in order"))
threading.Thread(target=time.sleep, args=(3600,), daemon=True).start()
if sys.argv[1] == "lasting":
    del sys.kept.__class__.__del__
    threading.Thread(target=lambda: (threading.main_thread().join(), sys.stdout.write("to its end, "))).start()
sys.argv[1:] = ["fk", "lab-scara", *sys.argv[2:]]
from steptwin.__main__ import main
main()
"""


def ended(*words: str) -> "subprocess.CompletedProcess[str]":
    program = [sys.executable, "-c", PROGRAM, *words]
    return subprocess.run(program, capture_output=True, text=True, timeout=TIMEOUT_S, check=False)


@pytest.mark.parametrize(("joints", "exit_code"), [(["150", "0", "90", "0"], 0), (["150"], 2)])
def test_what_holds_the_interpreter_up_does_not_hold_the_program_up(joints: list[str], exit_code: int) -> None:
    done = ended("daemon", *joints)
    assert done.returncode == exit_code
    assert done.stdout.startswith("x ") == (exit_code == 0)
    assert done.stdout.endswith("in order")


def test_a_thread_that_must_end_is_waited_for() -> None:
    done = ended("lasting", "150", "0", "90", "0")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.endswith("to its end, in order")
