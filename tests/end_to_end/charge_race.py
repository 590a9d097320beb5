"""Two `steptwin run`s for the same board, begun within 100 ms: one runs to its planned end, the other is refused.

`python -m tests.end_to_end.charge_race 200` makes 200 trials and prints how they ended; the tests make a few. Each
program is a process of its own. They are forked from one that has imported everything, so a trial takes few seconds
and not the time of two starts of Python.
"""

import os
import random
import sys
import time
from collections import Counter
from collections.abc import Iterator
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Barrier
from typing import Final

from steptwin.host.cli.app import run
from steptwin.host.common.errors import BusError
from tests.emulator.live.live_rig import TIMEOUT_S
from tests.end_to_end.served import Server, serving

ROBOT: Final = "warehouse-scara"
HOME: Final = "0 0 100 0 60 30"
BEGUN_WITHIN_S: Final = 0.1
ONE_RUNS: Final = (0, BusError.exit_code)
"""Exit codes of a trial, in order: done and where planned; refused because the other one is in charge."""
TRAJECTORY: Final = "t,sx,sz,L1,th1,th2,th3\n0,0,0,100,0,60,30\n1.5,0,0,100,4,62,30\n3,0,0,100,0,60,30\n"
"""A motion that ends where it starts, and lasts longer than any delay between two programs that begin together."""
_PROCESSES: Final = get_context("forkserver")
_IMPORTED: Final = [
    __name__,
    "steptwin.host.cli.run.run",
    "steptwin.host.operate.running",
    "steptwin.host.planning.planner",
    "steptwin.host.record.folder",
    "steptwin.host.twin.embedded.execution",
]


def exit_codes(server: Server, trials: int, seed: int) -> Iterator[tuple[int, ...]]:
    """Yield the exit codes of both programs, in order, of each trial on a served board."""
    chance = random.Random(seed)
    _PROCESSES.set_forkserver_preload(_IMPORTED)
    assert server.run("home", ROBOT, "--here", HOME) == 0
    with TemporaryDirectory() as folder:
        file = Path(folder) / "there-and-back.csv"
        file.write_text(TRAJECTORY, encoding="ascii")
        for _ in range(trials):
            # A computer that is too slow leaves the drives in fault; the next trial shall not find them so.
            assert server.run("reset", ROBOT) == 0
            assert server.run("move", ROBOT, *HOME.split()) == 0
            yield _trial(server.connected("run", ROBOT, str(file)), chance.uniform(0, BEGUN_WITHIN_S))


def _trial(words: list[str], apart_s: float) -> tuple[int, ...]:
    both_ready = _PROCESSES.Barrier(2)
    programs = [_PROCESSES.Process(target=_program, args=(words, both_ready, delay_s)) for delay_s in (0.0, apart_s)]
    for program in programs:
        program.start()
    for program in programs:
        program.join(TIMEOUT_S)
    codes = [program.exitcode for program in programs]
    return tuple(sorted(-1 if code is None else code for code in codes))


def _program(words: list[str], both_ready: Barrier, delay_s: float) -> None:
    """Run a command as soon as the other program is ready, after a delay, in silence."""
    both_ready.wait()
    time.sleep(delay_s)
    with open(os.devnull, "w") as nowhere:
        sys.stdout = sys.stderr = nowhere
        code = run(words)
    os._exit(code)


def main() -> None:
    """Make as many trials as the command line says; exit code 1 unless exactly one program ran in each."""
    trials = int(sys.argv[1])
    with serving(ROBOT) as server:
        ended = Counter(exit_codes(server, trials, seed=0))
    for codes, count in sorted(ended.items()):
        sys.stdout.write(f"{count} trials ended with exit codes {codes[0]} and {codes[1]}\n")
    sys.exit(ended != {ONE_RUNS: trials})


if __name__ == "__main__":
    main()
