"""An image's ADC, SPI, I2C and flash in an emulated machine: wiring.elf, built from wiring.c, tells what it sees."""

from pathlib import Path
from typing import Final

import pytest

from steptwin.controller.motion.backend import python_kernel
from steptwin.features.stm32.firmware import ImageFirmware
from steptwin.features.stm32.options import Stm32Options
from steptwin.features.stm32.serial_devices import I2cAt, SpiAt
from steptwin.host.common.errors import InputError
from steptwin.host.robots import load_robot
from steptwin.host.twin.machine.emulated_machine import EmulatedMachine, MachineParts
from steptwin.host.twin.machine.machine_options import MachineOptions
from steptwin.protocol.timer import COUNTS_PER_MS
from tests.features.stm32.examples import ROBOT

_IMAGE: Final = Path(__file__).parent / "wiring.elf"


class _Both:
    """An SPI device that inverts, and an I2C memory whose bytes are their addresses."""

    def __init__(self) -> None:
        self.selected = False
        self._at = 0

    def select(self) -> None:
        self.selected = True

    def deselect(self) -> None:
        self.selected = False

    def transfer(self, word: int) -> int:
        assert self.selected
        return word ^ 0xFFFF

    def start(self, *, read: bool) -> bool:  # noqa: ARG002
        return True

    def write(self, byte: int) -> bool:
        self._at = byte
        return True

    def read(self) -> int:
        self._at += 1
        return self._at - 1

    def stop(self) -> None:
        pass


def _said(tmp_path: Path, flash: Path | None, runs: int, *, compiled: bool = False) -> list[str]:
    """Return what the image says in so many runs of one machine, from power-up to power-up."""
    robot_file = tmp_path / "arm.toml"
    robot_file.write_text(
        ROBOT.read_text().replace("[joints.left.pins]", '[stm32]\nsupply = "PC0"\n\n[joints.left.pins]')
    )
    robot, both = load_robot(str(robot_file)), _Both()
    options = Stm32Options(image=_IMAGE, flash=flash, devices=(SpiAt(1, both, "PA4"), I2cAt(1, 0x50, both)))
    extras = (options.fitted(robot, tmp_path, compiled=compiled),)
    simulation = EmulatedMachine(MachineParts.of(robot, python_kernel(), MachineOptions(extras=extras))).simulation
    said = []
    for run in range(runs):
        if run:
            simulation.power_cycle()
        simulation.run_until(simulation.now_counts + 45 * COUNTS_PER_MS)
        firmware = simulation.boards[0].running
        assert isinstance(firmware, ImageFirmware)
        assert firmware.chip is not None
        said.append(firmware.chip.sent(0).decode())
    return said


def _expected(runs: int) -> str:
    supply, temperature = round(24.0 / 11 / 3.3 * 4095), round(1.43 / 3.3 * 4095)
    return f"supply {supply:08X}\ntemperature {temperature:08X}\nspi 0000EDCB\ni2c 00001213\nruns {runs:08X}\ndone\n"


@pytest.mark.slow  # 90 ms at 72 MHz in plain Python
def test_an_image_sees_supply_temperature_and_devices_and_its_flash_outlives_a_power_cycle(tmp_path: Path) -> None:
    assert _said(tmp_path, None, 2) == [_expected(1), _expected(2)]


@pytest.mark.slow  # numba compiles for half a minute
def test_the_compiled_chip_sees_the_same_and_a_file_keeps_its_flash(tmp_path: Path) -> None:
    pytest.importorskip("numba")
    flash = tmp_path / "flash.bin"
    for run in (1, 2):
        assert _said(tmp_path, flash, 1, compiled=True) == [_expected(run)]
    assert flash.read_bytes()[0xFC00:0xFC02] == b"\x02\x00"


@pytest.mark.parametrize(
    ("size", "sentence"), [(100, "has 100 bytes; the flash has 131072: give a file of such a run, or a new one")]
)
def test_a_file_of_another_size_is_refused(tmp_path: Path, size: int, sentence: str) -> None:
    (flash := tmp_path / "flash.bin").write_bytes(bytes(size))
    with pytest.raises(InputError, match=sentence):
        _said(tmp_path, flash, 0)
    with pytest.raises(InputError, match="is no place for a file"):
        _said(tmp_path, tmp_path / "none" / "flash.bin", 0)


def test_the_supply_needs_an_input_of_the_adc(tmp_path: Path) -> None:
    robot = tmp_path / "arm.toml"
    robot.write_text(ROBOT.read_text().replace("[joints.left.pins]", '[stm32]\nsupply = "PB5"\n\n[joints.left.pins]'))
    with pytest.raises(InputError, match="supply: PB5: is no input of the ADC: PA0 to PA7, PB0, PB1 or PC0 to PC5"):
        load_robot(str(robot))
