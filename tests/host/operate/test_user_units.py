"""A board whose units another master has chosen: commands refuse it in one line, `doctor` shows them, stops stop."""

import json

import pytest

from steptwin.host.operate.session import Session
from steptwin.host.operate.setting_up import WIRE_UNITS, AxisUnits, read_units
from steptwin.protocol import od
from tests.host.client.machines import TH1
from tests.host.operate.sessions import ROBOT, CommandLine

FOUND = "gear 1:1, feed 360000:1, in 10^-3 deg"
NEEDED = "gear 1:1, feed 3276800:1, in increments"
REFUSED = f"th1: node 0x13 has other units: {FOUND}; not {NEEDED}"


@pytest.fixture
def other_units(session: Session) -> Session:
    """A session on a machine one of whose axes counts in thousandths of a degree."""
    session.machine.disable()
    axis = session.machine.axes[TH1]
    axis.write(od.FEED_UNITS, 360_000)
    axis.write(od.SI_UNIT_POSITION, 0xFD41_0000)
    return session


@pytest.mark.parametrize(
    "command",
    [
        "status",
        "home",
        "move warehouse-scara th1=1",
        "jog warehouse-scara th1 1 --seconds 1",
        "reset",
        "outputs",
        "run",
    ],
)
@pytest.mark.usefixtures("other_units")
def test_commands_refuse_the_board(steptwin: CommandLine, command: str) -> None:
    words = {"run": "run warehouse-scara pull-line --approach"}.get(command, command)
    words = words if " " in words else f"{words} warehouse-scara"
    assert steptwin.run(words) == (2, "", f"steptwin: {REFUSED}; --force goes on all the same\n")


@pytest.mark.usefixtures("other_units")
def test_a_stop_is_never_refused_but_shows_no_positions(steptwin: CommandLine) -> None:
    exit_code, out, err = steptwin.run("stop warehouse-scara --json")
    assert exit_code == 2
    assert err.startswith(f"steptwin: {REFUSED}; warehouse-scara's axes were stopped")
    assert [axis["position"] for axis in json.loads(out)["axes"]] == [None] * len(ROBOT.joints)


@pytest.mark.slow
def test_doctor_has_a_row_for_units(steptwin: CommandLine, session: Session) -> None:
    exit_code, out, _ = steptwin.run("doctor warehouse-scara")
    assert exit_code == 0
    assert out.count(f" units: {NEEDED}\n") == len(ROBOT.joints)
    session.machine.disable()
    session.machine.axes[TH1].write(od.FEED_UNITS, 360_000)
    exit_code, out, _ = steptwin.run("doctor warehouse-scara")
    assert exit_code == 2
    assert [line for line in out.splitlines() if line.startswith("[FAIL]")] == [
        f"[FAIL] th1 units: gear 1:1, feed 360000:1, in increments; not {NEEDED}: "
        "another master has chosen them; set 0x6091 and 0x6092 back while the drive is off"
    ]


def test_factors_that_make_the_wire_unit_are_not_refused(steptwin: CommandLine, session: Session) -> None:
    session.machine.disable()
    axis = session.machine.axes[TH1]
    for address, value in (
        (od.GEAR_MOTOR_REVOLUTIONS, 10),
        (od.FEED_UNITS, 32_768_000),
        (od.SI_UNIT_POSITION, 0x0000_0000),
    ):
        axis.write(address, value)
    assert read_units(axis) == AxisUnits(10, 1, 32_768_000, 1, 0)
    assert steptwin.json("status warehouse-scara")["robot"] == ROBOT.name


@pytest.mark.parametrize(
    ("units", "text"),
    [
        (WIRE_UNITS, NEEDED),
        (AxisUnits(50, 3, 360, 7, 0x0041_0000), "gear 50:3, feed 360:7, in deg"),
        (AxisUnits(1, 1, 8000, 1, 0xFA01_0000), "gear 1:1, feed 8000:1, in 10^-6 m"),
        (AxisUnits(1, 1, 8000, 1, 0x0301_0000), "gear 1:1, feed 8000:1, in 10^3 m"),
        (AxisUnits(0, 0, 0, 0, 0x0002_0000), "gear 0:0, feed 0:0, in unit 0x00020000"),
    ],
)
def test_units_as_text(units: AxisUnits, text: str) -> None:
    assert str(units) == text


def test_factors_of_zero_make_no_unit() -> None:
    assert WIRE_UNITS.are_wire_units
    assert not AxisUnits(0, 0, 0, 0, WIRE_UNITS.si_unit).are_wire_units
