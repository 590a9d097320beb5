"""The module's switches: printed currents from the resistors; modes, decay and idle torque at the chip's pins."""

import pytest

from steptwin.controller.node.pins import Pin
from steptwin.emulator.drivers.tb6560.dip_switches import CURRENT_SETTINGS, CurrentSetting, switches_for
from steptwin.emulator.drivers.tb6560.pins import EXCITATIONS, FAST_DECAY_PERCENT, TORQUE_PERCENT


@pytest.mark.parametrize("setting", CURRENT_SETTINGS, ids=str)
def test_resistors_and_torque_make_the_printed_current(setting: CurrentSetting) -> None:
    printed_a = setting.printed_a
    switches = switches_for(printed_a, 16)
    held = switches.running
    percent = TORQUE_PERCENT[held[Pin.TQ2], held[Pin.TQ1]]
    assert 0.5 / switches.sense_ohm * percent / 100 == pytest.approx(printed_a, abs=0.1)
    assert switches.current is setting


def test_there_are_fourteen_settings_of_14_different_switch_positions() -> None:
    assert [setting.printed_a for setting in CURRENT_SETTINGS] == [
        0.3, 0.5, 0.8, 1.0, 1.1, 1.2, 1.4, 1.5, 1.6, 1.9, 2.0, 2.2, 2.6, 3.0
    ]  # fmt: skip
    assert len({setting[1:] for setting in CURRENT_SETTINGS}) == 14
    three = CURRENT_SETTINGS[-1]
    assert (three.sw1, three.sw2, three.sw3, three.s1) == (True, True, True, False)


@pytest.mark.parametrize("microsteps", [1, 2, 8, 16])
@pytest.mark.parametrize("decay", [0, 25, 50, 100])
def test_mode_and_decay(microsteps: int, decay: int) -> None:
    held = switches_for(1.0, microsteps, decay).running
    assert EXCITATIONS[held[Pin.M2], held[Pin.M1]] == microsteps
    assert FAST_DECAY_PERCENT[held[Pin.DCY2], held[Pin.DCY1]] == decay


def test_full_steps_and_slow_decay_are_all_off() -> None:
    switches = switches_for(3.0, 1)
    assert (switches.s3, switches.s4, switches.s5, switches.s6) == (False,) * 4


@pytest.mark.parametrize("idle", [20, 50])
def test_idle_torque(idle: int) -> None:
    switches = switches_for(3.0, 1, idle_percent=idle)
    assert TORQUE_PERCENT[switches.standing[Pin.TQ2], switches.standing[Pin.TQ1]] == idle
    assert switches.s2 == (idle == 50)


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ({"current_a": 1.3, "microsteps": 16}, r"1\.3 A is not one of the module's settings: .* 1\.2 A and 1\.4 A"),
        ({"current_a": 9, "microsteps": 16}, r"9 A is not one .* 2\.6 A and 3 A"),
        ({"current_a": 1, "microsteps": 4}, "4 steps of a full step is not one of 1, 2, 16, 8"),
        ({"current_a": 1, "microsteps": 1, "fast_decay_percent": 30}, "30 % fast decay is not one of 0, 25, 50, 100"),
        ({"current_a": 1, "microsteps": 1, "idle_percent": 0}, "0 % at standstill is neither 20 % nor 50 %"),
    ],
)
def test_what_cannot_be_set(setting: dict[str, float], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        switches_for(**setting)  # type: ignore[arg-type]
