"""`steptwin check part.gcode ROBOT` and `steptwin run ROBOT part.gcode`: without a program around the file."""

from pathlib import Path

import pytest

from tests.end_to_end.command_line import refusal, run_json

ROBOT = "corexy-gantry"
PRINT = "M104 S200\nSTART_PRINT\nG28\nG1 X240 Y10 F6000\nG1 X230 Y10 E1\nG1 X230 Y20 E1\nM84\n"


@pytest.fixture
def part(tmp_path: Path) -> Path:
    path = tmp_path / "part.gcode"
    path.write_text(PRINT, encoding="utf-8")
    return path


def test_check_tells_what_is_ignored(part: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = run_json(capsys, "check", str(part), ROBOT, "--dialect", "klipper")
    assert found["kind"] == "gcode"
    (step,) = found["steps"]
    assert step["text"] == "gcode part.gcode"
    assert step["notes"][1:] == [
        "ignored: E 2 times, M104 1 time, M84 1 time, START_PRINT 1 time",
        "START_PRINT: may move the machine; its moves are not in the file",
    ]


def test_check_tells_all_refusals_at_once(part: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = run_json(capsys, "check", str(part), ROBOT, exit_code=2)
    assert [message.split(" ")[:3] for message in found["findings"]] == [
        ["line", "1:", "M104"], ["line", "2:", "'START_PRINT'"], ["line", "5:", "E1"], ["line", "6:", "E1"],
        ["line", "7:", "M84"],
    ]  # fmt: skip


def test_latin_1_and_keys_of_the_step(part: Path, capsys: pytest.CaptureFixture[str]) -> None:
    part.write_bytes(b"; gr\xfcn\r\nMY_MACRO\r\nG1 X200 Y10 F6000\r\nG1 X230 Y10\r\nG1 X230 Y40\r\n")
    options = ("--dialect", "klipper", "-o", "ignore=MY_MACRO,M900", "-o", "blend_mm=5", "-o", "feed_max_mm_s=50")
    (step,) = run_json(capsys, "check", str(part), ROBOT, *options)["steps"]
    assert step["notes"] == [
        "3 lines: 1 path of the tool without a stop, 2 corners rounded, 0 stops at corners",
        "ignored: MY_MACRO 1 time",
    ]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("run", ROBOT, "{}"), "{}: line 1: M104 is not understood without a dialect; it is in klipper, marlin"),
        (("run", ROBOT, "{}", "-o", "speed=3"), "{}: speed: key 'speed' is unknown: did you mean speed_percent?"),
        (("run", ROBOT, "{}", "-o", "dialect=klippr"), "{}: dialect: 'klippr' is not one of klipper, marlin, grbl, "),
        (("run", ROBOT, "none.nc"), "none.nc: No such file or directory"),
        (
            ("run", ROBOT, "drawing.toml", "--dialect", "grbl"),
            "--dialect: is for files of G-code, .gcode, .nc, .ngc, not",
        ),
        (("check", "drawing.toml", "--dialect", "grbl"), "--dialect: is for files of G-code, .gcode, .nc, .ngc, not"),
        (("check", "drawing.toml", "-o", "blend_mm=1"), "option blend_mm: drawing.toml is not a file that a step runs"),
    ],
)
def test_what_is_refused(words: tuple[str, ...], message: str, part: Path, capsys: pytest.CaptureFixture[str]) -> None:
    told = refusal(capsys, *(word.format(part) for word in words))
    assert message.format(part) in told, told


@pytest.mark.slow
def test_it_runs(part: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_json(capsys, "run", ROBOT, str(part), "--dialect", "klipper")["passed"]
    assert run_json(capsys, "run", ROBOT, str(part), "-o", "dialect=klipper", "-o", "ignore=M104")["passed"]
