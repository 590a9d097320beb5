"""Inputs that ask for a motion of days, or for more steps and keys than there may be, are refused in little memory."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.live

HEAD = 'robot = "teaching-scara"\n'
BENT = f"{HEAD}[[step]]\ngo = {{ th1 = 10.0, th2 = 40.0 }}\n"
HOUR = "more than an hour, 3600 s"

PROGRAMS = {
    f"{HEAD}[[step]]\ngo = {{ th1 = 10.0 }}\nduration_s = 100000.0\n": f"lasts 100000 s, {HOUR}",
    f"{HEAD}[[step]]\ngo = {{ th1 = 10.0 }}\nduration_s = 3600.001\n": f"lasts 3600.001 s, {HOUR}",
    f"{HEAD}[[step]]\ngo = {{ th1 = 10.0 }}\nspeed_percent = 0.001\n": HOUR,
    f"{HEAD}[[step]]\npause = 100000.0\n": f"lasts 100000 s, {HOUR}",
    f"{HEAD}[[step]]\nrepeat = 5000\nsteps = [{{ pause = 3000.0 }}]\n": f"lasts 6000 s, {HOUR}",
    f"{BENT}[[step]]\nby = {{ z = -20.0 }}\nspeed_mm_s = 0.00001\n": "the motion lasts 2e+06 s, it must be at most",
    f"{BENT}[[step]]\nby = {{ z = -20.0 }}\nspeed_mm_s = 0.0001\n": HOUR,
    f"{BENT}[[step]]\nby = {{ z = -20.0 }}\nspeed_mm_s = 10.0\nramp_s = 100000.0\n": HOUR,
    f"{BENT}[[step]]\ncircle = {{ x = 150.0, y = 100.0 }}\nsweep_deg = 36000.0\nspeed_mm_s = 0.1\n": HOUR,
    f"{HEAD}{'.'.join(['a'] * 20_000)} = 1\n": "is more than 16 keys joined by points",
    f"{HEAD}[{'.'.join(['a'] * 20_000)}]\n": "is more than 16 keys joined by points",
    f"{HEAD}x = {{ {'.'.join(['a'] * 20_000)} = 1 }}\n": "is more than 16 keys joined by points",
    HEAD + "[[step]]\npause = 1\n" * 200_000: "bytes, more than 1 MiB",
    f"{HEAD}step = [{'{pause=1},' * 60_000}]\n": "step: has 60000 steps, more than 5000",
    f"{HEAD}[[step]]\nrepeat = 10000\nsteps = [{{ pause = 0.001 }}]\n": "a program has at most 5000 steps",
}
"""What is wrong with each program."""


def bounded(commands: list[list[str]], folder: Path) -> list[Any]:
    """Run commands in a process of its own with 2 GiB of addresses and a minute of a processor."""
    file = folder / "commands.json"
    file.write_text(json.dumps(commands), encoding="utf-8")
    child = [sys.executable, "-m", "tests.end_to_end.bounded_child", str(file)]
    ran = subprocess.run(child, capture_output=True, text=True, check=False)
    assert (ran.returncode, ran.stderr) == (0, "")
    answers: list[Any] = json.loads(ran.stdout)
    return answers


@pytest.fixture(scope="module")
def answers(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    folder = tmp_path_factory.mktemp("programs")
    files = [folder / f"{number}.toml" for number in range(len(PROGRAMS))]
    for file, text in zip(files, PROGRAMS, strict=True):
        file.write_text(text, encoding="utf-8")
    return dict(zip(PROGRAMS, bounded([["check", str(file)] for file in files], folder), strict=True))


@pytest.mark.parametrize("text", PROGRAMS, ids=lambda text: text[25:65].strip())
def test_a_program_of_days_is_refused(answers: dict[str, Any], text: str) -> None:
    """100 000 s took 2.5 GB, 0.00001 mm/s 5.5 GB, and the dotted keys 1.5 GB."""
    code, said, mib = answers[text]
    assert code == 2
    assert PROGRAMS[text] in said
    assert mib < 200


def test_an_hour_passes_in_little_memory(tmp_path: Path) -> None:
    """It is looked at in windows: as one it took 630 MB.

    Of these, 100 MiB are numba's, which tells what motors need, and 50 more where it compiles for the first time.
    """
    program, points = tmp_path / "hour.toml", tmp_path / "hour.csv"
    program.write_text(f"{HEAD}[[step]]\ngo = {{ th1 = 10.0 }}\nduration_s = 3600.0\n", encoding="utf-8")
    points.write_text("t,th1,th2,d3,th4\n0,0,0,0,0\n100000,10,0,0,0\n", encoding="utf-8")
    run = ["run", "teaching-scara"]
    (code, said, mib), *refused = bounded(
        [
            ["check", str(program)],
            [*run, str(points)],
            [*run, str(program), "--stretch", "2"],
        ],
        tmp_path,
    )
    assert (code, said) == (0, "")
    assert mib < 330
    for (code, said, mib), why in zip(
        refused,
        (
            "hour.csv: line 3, t: 100000 s is more than 3600 s: are the times in ms?",
            "--stretch 2: makes a motion of 7200 s, more than an hour; the largest is 1\n",
        ),
        strict=True,
    ):
        assert (code, why in said) == (2, True), said
        assert mib < 360
