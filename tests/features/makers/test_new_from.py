"""`steptwin new my.toml --from FILE`: the command line of a controller's configuration."""

import json
from pathlib import Path

import pytest

from steptwin.host.cli.app import run
from steptwin.host.robots import load_robot_file
from tests.end_to_end.command_line import PROGRAM, refusal
from tests.end_to_end.terminal import Terminal
from tests.features.makers.test_configurations import INPUTS


def test_a_printer_becomes_a_robot(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mine = tmp_path / "mine.toml"
    assert run(["new", str(mine), "--from", str(INPUTS / "klipper" / "bed-slinger.cfg"), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert (document["kind"], document["joints"]) == ("cartesian", ["X", "Y", "Z"])
    assert document["notes"][-1] == "fill in: driver_profile: a4988 is assumed; --set driver_profile=NAME"
    assert "rotation_distance: 40" in mine.read_text(encoding="utf-8")
    assert run(["check", str(mine)]) == 0
    motion = tmp_path / "motion.csv"
    motion.write_text("t,X,Y,Z\n0,0,0,0.4\n1,20,10,1\n2,0,0,0.4\n")
    assert run(["run", str(mine), str(motion)]) == 0
    assert capsys.readouterr().out.endswith("PASSED\n")


def test_what_the_user_says_goes_before_the_file(tmp_path: Path) -> None:
    mine, listed = tmp_path / "mine.toml", str(INPUTS / "grbl" / "router.txt")
    settings = ("X.travel_per_turn=6.4", "driver_profile=dm542", "Z.motor=17HS19-2004S1")
    words = [word for each in settings for word in ("--set", each)]
    assert run(["new", str(mine), "--from", listed, "--controller", "grbl", *words]) == 0
    text = mine.read_text(encoding="utf-8")
    assert "microsteps = 8" in text
    assert 'driver_profile = "dm542"' in text
    assert 'model = "17HS19-2004S1"' in text


def test_a_motor_brings_all_that_motors_need(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mine, printer = tmp_path / "mine.toml", str(INPUTS / "klipper" / "bed-slinger.cfg")
    assert run(["new", str(mine), "--from", printer, "--set", "X.motor=17HS16-2004S1", "--set", "Y.mass_kg=0.9"]) == 0
    assert capsys.readouterr().out.splitlines()[-4:-1] == [
        "fill in: motors of Y, Z: 17HS16-2004S1 is assumed; --set Y.motor=MODEL",
        "fill in: masses of X, Z: 0.5 kg are assumed; --set X.mass_kg=KG",
        "fill in: supply: 24 V are assumed; --set supply_v=V",
    ]
    motion = tmp_path / "motion.csv"
    motion.write_text("t,X,Y,Z\n0,0,0,10\n0.5,5,4,10\n")
    assert run(["run", str(mine), str(motion), "--motors"]) == 0
    assert "motors: keep step" in capsys.readouterr().out


@pytest.mark.parametrize(
    "words",
    [
        ["--from", "{inputs}/grbl/router.txt", "--controller", "grblhal"],
        ["--from", "{inputs}/grbl/router.txt", "--controller", "klipper"],
        ["--from", "{inputs}/grbl/router.txt", "--kind", "scara"],
        ["--from", "{inputs}/linuxcnc/mill.hal"],
        ["--from", "ar4-mk3", "--controller", "grbl"],
        ["--controller", "grbl"],
        ["--from", "{inputs}/grbl/router.txt", "--urdf", "arm.urdf"],
    ],
    ids=["controller", "other controller", "kind", "no configuration", "robot", "alone", "two sources"],
)
def test_what_does_not_go_together(words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mine = tmp_path / "mine.toml"
    refusal(capsys, "new", str(mine), *(word.format(inputs=INPUTS) for word in words))
    assert not mine.exists()


@pytest.mark.slow
def test_what_the_file_does_not_say_is_asked_on_a_terminal(tmp_path: Path) -> None:
    words = [*PROGRAM, "new", "mine.toml", "--from", str(INPUTS / "linuxcnc" / "turning-table.ini")]
    with Terminal(words, tmp_path) as terminal:
        terminal.await_text("A.lower, least position in deg: ")
        terminal.type("-180\n")
        terminal.await_text("A.upper, greatest position in deg: ")
        terminal.type("far\n")
        terminal.await_text("'far' is not a number")
        terminal.type("180\n")
        assert terminal.await_exit() == 0
    table = load_robot_file(str(tmp_path / "mine.toml")).joints[-1]
    assert (table.lower, table.upper) == (-180.0, 180.0)
