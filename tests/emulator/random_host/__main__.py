"""Run many sessions of the random host in parallel.

A failing session is named by its seed, written to a file and, if asked for, shortened:

    python -m tests.emulator.random_host --sessions 20000 --seed 1 --jobs 2
    python -m tests.emulator.random_host --seed 4711 --shrink
    python -m tests.emulator.random_host --replay random-host-4711.jsonl
"""

import sys
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from tests.emulator.random_host.session import Session
from tests.emulator.random_host.shrink import shrunk
from tests.emulator.random_host.trial import Outcome, fault_of, trial

_COMMAND = "python -m tests.emulator.random_host"
_TOLD_EACH = 500
"""Number of sessions after which the command says how far it is."""


def main() -> int:
    """Run what the command line asks for; return 1 if a session fails."""
    parser = ArgumentParser(prog=_COMMAND, description=__doc__, formatter_class=RawDescriptionHelpFormatter)
    parser.add_argument("--sessions", type=int, default=1, help="number of sessions")
    parser.add_argument("--seed", type=int, default=1, help="seed of the first session; the next have the next seeds")
    parser.add_argument("--jobs", type=int, default=1, help="number of processes")
    parser.add_argument("--shrink", action="store_true", help="shorten failing sessions, which takes a while")
    parser.add_argument("--replay", type=Path, help="a recorded session to execute instead")
    options = parser.parse_args()
    if options.replay:
        fault = fault_of(Session.load(options.replay))
        sys.stdout.write(f"{fault or 'everything holds'}\n")
        return int(bool(fault))
    seeds = range(options.seed, options.seed + options.sessions)
    failures = pulses = frames = 0
    with ProcessPoolExecutor(options.jobs) as pool:
        for done, outcome in enumerate(pool.map(trial, seeds, chunksize=10), start=1):
            pulses, frames = pulses + outcome.pulses, frames + outcome.frames
            if outcome.fault:
                failures += 1
                _report(outcome, shrink=options.shrink)
            if done % _TOLD_EACH == 0 or done == len(seeds):
                sys.stdout.write(f"{done} sessions, {failures} failed; {pulses:,} pulses, {frames:,} frames\n")
                sys.stdout.flush()
    return int(failures > 0)


def _report(outcome: Outcome, *, shrink: bool) -> None:
    """Say which session failed and how to repeat it."""
    path = Path(f"random-host-{outcome.seed}.jsonl")
    session = outcome.session
    if shrink:
        kind = fault_of(session).partition(":")[0]
        if kind:
            session = shrunk(session, lambda shorter: fault_of(shorter).partition(":")[0] == kind)
    session.save(path)
    sys.stdout.write(f"seed {outcome.seed}: {outcome.fault}\n  again: {_COMMAND} --seed {outcome.seed}\n")
    sys.stdout.write(f"  as frames: {_COMMAND} --replay {path}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
