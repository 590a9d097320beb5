"""Try whether the tests notice mistakes: each mutation is made in a copy of the checkout, whose tests must then fail.

`python -m tests.mutations` asks the tests of `make test`, `--all` those that `make test-all` runs without a browser or
servers. A name after it chooses mutations whose file or text contains it. The exit code is the number that survived.
"""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

ROOT: Final = Path(__file__).resolve().parents[1]
FAST, ALL = "not slow and not live", "not live"
_NOT_COPIED: Final = shutil.ignore_patterns(".git", ".venv", "out", ".mypy_cache", ".pytest_cache", ".hypothesis")


@dataclass(frozen=True)
class Mutation:
    """A mistake: in `path`, `right`, which occurs once, becomes `wrong`; `near` are the tests that are asked first."""

    path: str
    right: str
    wrong: str
    near: str

    def __str__(self) -> str:
        return f"{self.path}: {self.right.strip()} -> {self.wrong.strip()}"

    def apply(self, root: Path) -> None:
        """Make the mistake in a copy of the checkout."""
        file = root / self.path
        source = file.read_text(encoding="utf-8")
        if source.count(self.right) != 1:
            raise ValueError(f"{self.path}: {self.right!r} occurs {source.count(self.right)} times, not once")
        file.write_text(source.replace(self.right, self.wrong), encoding="utf-8")


KERNEL, MOTION = "controller/motion/kernel.py", "tests/controller/motion"
NODE, DRIVERS = "tests/controller/node tests/controller/modes", "tests/emulator/drivers"
VERIFY, PLANNING, SHADOW = "tests/host/verify", "tests/host/planning", "tests/features/shadow"
DRIVE, CHIP = "controller/node/axis_drive.py", "emulator/drivers/chip.py"
STATES, STOPS = "controller/node/power_states.py", "controller/node/stops.py"
ORACLE, VERIFIER = "host/verify/oracle.py", "host/verify/verifier.py"
PLANNER, COMPARED = "host/planning/planner.py", "features/shadow/axes.py"

MUTATIONS: Final = (
    # --- kernel
    Mutation(KERNEL, "pulse > interval_q16 >> 16", "pulse > (interval_q16 >> 16) + 1", MOTION),
    Mutation(KERNEL, "* microsteps + 32) >> 6", "* microsteps) >> 6", MOTION),
    Mutation(KERNEL, "delayed += rise > due", "delayed += rise >= due", MOTION),
    Mutation(KERNEL, "max(axes[base + DIRHOLD_COUNTS], 1)", "axes[base + DIRHOLD_COUNTS]", MOTION),
    Mutation(KERNEL, "if left_q16 < rate_q16:", "if left_q16 <= rate_q16:", MOTION),
    Mutation(KERNEL, "if fastest * TICKS_PER_MS >", "if fastest * TICKS_PER_MS >=", MOTION),
    # --- drive states
    Mutation(STATES, "if controlword & ~previous & Control.FAULT_RESET", "if controlword & Control.FAULT_RESET", NODE),
    Mutation(STATES, "(_SO, DriveCommand.QUICK_STOP): _SOD", "(_SO, DriveCommand.QUICK_STOP): _QSA", NODE),
    Mutation(DRIVE, "inputs & ~self.supervision.inputs & DigitalInput.ESTOP", "inputs & DigitalInput.ESTOP", NODE),
    Mutation(DRIVE, "now_us < self._settled_us", "now_us <= self._settled_us", NODE),
    Mutation(STOPS, "if velocity and not self._motion.running:", "if not self._motion.running:", NODE),
    # --- verifier and its gate
    Mutation(ORACLE, "HYSTERESIS_STEPS = 1 / 16", "HYSTERESIS_STEPS = 1 / 15.9", VERIFY),
    Mutation(ORACLE, "floor(abs(distance_steps) - THRESHOLD_STEPS) + 1", "floor(abs(distance_steps))", VERIFY),
    Mutation(VERIFIER, "not position_steps <= position_limit", "position_steps > 1.01 * position_limit", VERIFY),
    Mutation(VERIFIER, "axis.unmatched_steps > 0, f", "axis.unmatched_steps > 1, f", VERIFY),
    Mutation("host/verify/gates.py", "STEPS: Final = 0.0075", "STEPS: Final = 0.0085", VERIFY),
    # --- drivers
    Mutation(CHIP, 'rises, side="right")]', 'rises, side="left")]', DRIVERS),
    Mutation(
        CHIP, "if since is not None and since < self._limit(rule):", "if since is not None and since < 0:", DRIVERS
    ),
    Mutation(CHIP, "broken = heard & (values < self", "broken = heard & (values <= self", DRIVERS),
    Mutation(CHIP, "= rises[0] - self._last_rise_counts, rises", "= rises[0], rises", DRIVERS),
    # --- planner
    Mutation(PLANNER, "np.diff(times_ms, prepend=-1) > 0", "np.diff(times_ms, prepend=-1) >= 0", PLANNING),
    Mutation(PLANNER, "np.arange(-from_ms % point_ms", "np.arange(from_ms % point_ms", PLANNING),
    Mutation(PLANNER, "checks.check_peaks(looked.excess)", "", PLANNING),
    # --- shadow
    Mutation(COMPARED, "CLOCK_DRIFT: Final = 100e-6", "CLOCK_DRIFT: Final = 1000e-6", SHADOW),
    Mutation(COMPARED, "STANDSTILL_TOLERANCE_STEPS: Final = 1.0", "STANDSTILL_TOLERANCE_STEPS: Final = 2.0", SHADOW),
)


def killed(mutation: Mutation, chosen: str) -> bool:
    """Return whether a test fails with the mutation: of those near it, or else of all that are chosen."""
    with TemporaryDirectory() as folder:
        copy = Path(folder) / "steptwin"
        shutil.copytree(ROOT, copy, symlinks=True, ignore=_NOT_COPIED)
        mutation.apply(copy)
        return any(_fail(copy, tests, chosen) for tests in (mutation.near.split(), ["tests"]))


def _fail(copy: Path, tests: Iterable[str], chosen: str) -> bool:
    ended = subprocess.run(
        [sys.executable, "-m", "pytest", "-x", "-q", "-n", "auto", "--dist", "worksteal", "-m", chosen, *tests],
        cwd=copy,
        env={**os.environ, "PYTHONPATH": str(copy), "OPENBLAS_NUM_THREADS": "1"},
        capture_output=True,
        check=False,
    )
    if ended.returncode not in (0, 1, 2):
        raise RuntimeError(ended.stdout.decode()[-2000:])
    return ended.returncode != 0


def main(words: list[str]) -> int:
    """Try the chosen mutations, print what became of each, and return how many survived."""
    chosen = ALL if "--all" in words else FAST
    names = [word for word in words if not word.startswith("--")]
    survived = 0
    for mutation in MUTATIONS:
        if all(name in str(mutation) for name in names):
            dead = killed(mutation, chosen)
            survived += not dead
            sys.stdout.write(f"{'killed  ' if dead else 'SURVIVED'}  {mutation}\n")
            sys.stdout.flush()
    return survived


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
