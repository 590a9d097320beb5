"""The 3 A module's switches: printed currents from the resistors; modes, decay and idle torque at the chip's pins."""

import pytest

from steptwin.emulator.drivers.driver_module import Switches, fitted
from steptwin.protocol.drivers import CurrentSetting
from steptwin.protocol.drivers.tb6560 import THREE_AMP_MODULE
from tests.messages import refusing

assert THREE_AMP_MODULE.currents is not None
CURRENT_SETTINGS = THREE_AMP_MODULE.currents.value
CHIP = THREE_AMP_MODULE.chip


def switches_for(
    current_a: float, microsteps: int, fast_decay_percent: int | None = None, idle_percent: int | None = None
) -> Switches:
    module = fitted(
        THREE_AMP_MODULE, microsteps, current_a, fast_decay_percent=fast_decay_percent, idle_percent=idle_percent
    )
    switches = module.switches
    assert switches is not None
    return switches


@pytest.mark.parametrize("setting", CURRENT_SETTINGS, ids=str)
def test_resistors_and_torque_make_the_printed_current(setting: CurrentSetting) -> None:
    printed_a = setting.printed_a
    module = fitted(THREE_AMP_MODULE, 16, printed_a)
    assert module.switches is not None
    percent = CHIP.torque_percent.value.selected(module.switches.running)
    assert percent is not None
    assert module.full_a * percent / 100 == pytest.approx(printed_a, abs=0.1)
    resistors = {"SW1": 0.33, "SW2": 0.5, "SW3": 1.2}
    assert module.full_a == pytest.approx(
        0.5 * sum(1 / ohm for name, ohm in resistors.items() if name in setting.switches)
    )
    assert percent == (75 if "S1" in setting.switches else 100)


def test_there_are_fourteen_settings_of_14_different_switch_positions() -> None:
    assert [setting.printed_a for setting in CURRENT_SETTINGS] == [
        0.3, 0.5, 0.8, 1.0, 1.1, 1.2, 1.4, 1.5, 1.6, 1.9, 2.0, 2.2, 2.6, 3.0
    ]  # fmt: skip
    assert len({setting.switches for setting in CURRENT_SETTINGS}) == 14
    assert CURRENT_SETTINGS[-1].switches == ("SW1", "SW2", "SW3")


@pytest.mark.parametrize("microsteps", [1, 2, 8, 16])
@pytest.mark.parametrize("decay", [0, 25, 50, 100])
def test_mode_and_decay(microsteps: int, decay: int) -> None:
    held = switches_for(1.0, microsteps, decay).running
    assert CHIP.modes.value.selected(held) == microsteps
    assert CHIP.fast_decay_percent.value.selected(held) == decay


def test_full_steps_and_slow_decay_are_all_off() -> None:
    running = switches_for(3.0, 1).running
    assert [running[pin] for pin in ("M1", "M2", "DCY1", "DCY2")] == [0, 0, 0, 0]


@pytest.mark.parametrize(("idle", "levels"), [(20, (1, 1)), (50, (1, 0))])
def test_idle_torque(idle: int, levels: tuple[int, int]) -> None:
    """TQ2 alone, or both."""
    standing = switches_for(3.0, 1, idle_percent=idle).idle
    assert (standing["TQ2"], standing["TQ1"]) == levels


@pytest.mark.parametrize(
    "setting",
    [
        {"current_a": 1.3, "microsteps": 16},
        {"current_a": 9, "microsteps": 16},
        {"current_a": 1, "microsteps": 4},
        {"current_a": 1, "microsteps": 1, "fast_decay_percent": 30},
        {"current_a": 1, "microsteps": 1, "idle_percent": 0},
    ],
)
def test_what_cannot_be_set(setting: dict[str, float]) -> None:
    with refusing(ValueError):
        switches_for(**setting)  # type: ignore[arg-type]
