"""Settings that a board keeps for its drives: read, written, and refused with the nearest that passes."""

import pytest

from steptwin.features.panel.service.settings import DRIVE_SETTINGS, DriveSetting, drive_setting, drive_settings
from steptwin.host.common.errors import InputError
from steptwin.host.operate.session import Session
from steptwin.host.robots import load_robot
from tests.host.client.machines import TH1
from tests.host.operate.sessions import ROBOT
from tests.messages import refusing


@pytest.mark.parametrize("setting", DRIVE_SETTINGS, ids=lambda setting: setting.key)
def test_what_is_written_is_read_again(session: Session, setting: DriveSetting) -> None:
    """Both ends of the range are allowed, and what is just outside is not; the board takes all of them."""
    before = setting.read(session)
    assert len(set(before)) == 1
    joint = None if setting.shared else "th1"
    for value in (setting.lower, setting.upper):
        setting.write(session, value, joint)
        wanted = [value if joint is None or axis == TH1 else before[axis] for axis in range(6)]
        assert list(setting.read(session)) == wanted
    for value in (setting.lower - 0.1, setting.upper + 0.1):
        with refusing(InputError):
            setting.write(session, value, joint)


def test_a_motion_begins_with_the_settings_that_were_written(session: Session) -> None:
    """Taking charge writes what the robot's file says, and leaves the rest."""
    torque = drive_setting("torque", session.robot)
    torque.write(session, 50.0, "th1")
    with session.charge("nothing") as charge:
        charge.enable()
        assert torque.read(session)[TH1] == 50.0


def test_an_unknown_setting_is_refused() -> None:
    with refusing(InputError):
        drive_setting("torq", ROBOT)


def test_currents_that_switches_at_the_drivers_set_are_no_settings_of_the_board() -> None:
    arm = load_robot("ar4-mk3")
    assert [setting.key for setting in drive_settings(arm)] == ["supply_min", "supply_max", "temperature_max"]
    assert drive_settings(ROBOT) == DRIVE_SETTINGS
    with refusing(InputError):
        drive_setting("torque", arm)
