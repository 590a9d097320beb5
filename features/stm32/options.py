"""The image of an STM32F103 that the board of an emulated machine runs, and its pins."""

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, replace
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

from steptwin.host.cli.live.served_programs import ServedPlace, ServedProgram
from steptwin.host.cli.options import option
from steptwin.host.common.errors import InputError
from steptwin.host.common.extras import installing
from steptwin.host.common.numbers import whole
from steptwin.host.twin.machine.machine_options import SPELLING, Spelling

if TYPE_CHECKING:
    from steptwin.emulator.board.board_firmware import BoardProgram
    from steptwin.features.stm32.section import JointPins, Stm32
    from steptwin.features.stm32.serial_devices import I2cAt, SpiAt
    from steptwin.host.robots.robot import Robot

_IMAGE: Final = Spelling(
    key="image",
    value="FILE",
    example='"build/fw.elf"',
    says="Let the board run this image of an STM32F103, wired as the robot file's pins say (docs/firmware.md).",
    served=True,
)

_FLASH: Final = Spelling(
    key="flash",
    value="FILE",
    example='"flash.bin"',
    says="Keep what the image programs into its flash in this file, from run to run.",
    served=True,
)


def _port(text: str) -> int:
    try:
        return whole(text)
    except ValueError:
        raise InputError(f"uart_port={text}: is no port number; 0 takes a free one") from None


_UART_PORT: Final = Spelling(
    key="uart-port",
    value="PORT",
    example="7000",
    says="Serve the image's USART1 at this TCP port, 0 for a free one, and at a pseudo terminal.",
    read=_port,
    served=True,
)


class WiredAxis(NamedTuple):
    """An axis with the microsteps of its driver, and its pins."""

    name: str
    microsteps: int
    pins: "JointPins"


@dataclass(frozen=True, slots=True, kw_only=True)
class Stm32Options:
    """An image that the board runs instead of our firmware; None: ours. `fitted` adds what the robot file says."""

    image: Path | str | None = field(default=None, metadata={SPELLING: _IMAGE})
    uart_port: int | None = field(default=None, metadata={SPELLING: _UART_PORT})
    flash: Path | str | None = field(default=None, metadata={SPELLING: _FLASH})
    devices: "tuple[SpiAt | I2cAt, ...]" = ()
    """Devices at the chip's SPI and I2C, for tests."""

    def over(self, other: "Stm32Options") -> "Stm32Options":
        """Return other options, with those of these that are no defaults in place of theirs."""
        port = other.uart_port if self.uart_port is None else self.uart_port
        return replace(other if self.image is None else self, uart_port=port)

    def fitted(self, robot: "Robot", folder: Path, *, compiled: bool | None = None) -> "Stm32Options":
        """Return the options of a robot's machine, with a relative path that begins at a folder.

        For `compiled` see `FittedOptions`.

        Raises:
            InputError: the robot's file does not say which pins are wired to what.
        """
        if self.image is None:
            return self
        from steptwin.features.stm32.section import TABLE, Stm32, wiring_of

        if not any(TABLE in joint.tables for joint in robot.joints):
            raise InputError(
                f"image={self.image}: {robot.name} does not say what hangs at which pin:"
                f" it has no [joints.NAME.{TABLE}]"
            )
        table, pins = robot.sections.get("stm32", Stm32()), wiring_of(robot)
        assert isinstance(table, Stm32)
        return FittedOptions(
            image=folder / self.image,
            uart_port=self.uart_port,
            devices=self.devices,
            flash=None if self.flash is None else folder / self.flash,
            chip=table,
            axes=tuple(WiredAxis(axis.name, axis.transmission.microsteps, pins[axis.name]) for axis in robot.axes),
            compiled=compiled,
        )

    def program(self) -> "Callable[[], BoardProgram] | None":
        """Return what makes the program of a board; None for our own."""
        if self.image is not None:
            raise InputError(f"image={self.image}: needs the robot's file, with the pins of its joints")
        return None


@dataclass(frozen=True, slots=True, kw_only=True)
class ImageServing(ServedProgram):
    """Options of `steptwin serve` for an image."""

    image: str | None = option("FILE", "Let the board run this image of an STM32F103 (docs/firmware.md).")
    uart_port: int | None = option(
        "PORT", "Serve the image's USART1 at this TCP port, 0 for a free one, and at a pseudo terminal."
    )

    @property
    def extras(self) -> Sequence[object]:
        """The image as an option of the machine."""
        if self.image is None and self.uart_port is None:
            return ()
        if self.image is None:
            raise InputError("--uart-port: is for the image of --image FILE")
        return (Stm32Options(image=self.image, uart_port=self.uart_port),)

    @property
    def wanted(self) -> bool:
        """False: there is no program beside the board."""
        return False

    def running(self, *, to_stderr: bool) -> AbstractContextManager[Callable[[ServedPlace], None]]:
        """Never called: there is no program."""
        del to_stderr
        return nullcontext(lambda _: None)


@dataclass(frozen=True, slots=True, kw_only=True)
class FittedOptions(Stm32Options):
    """The same for one robot's machine: with its table `[stm32]`, and what is wired to its axes."""

    chip: "Stm32"
    axes: tuple[WiredAxis, ...]
    compiled: bool | None = None
    """True for the chip compiled by numba, False for plain Python, None for numba where it is installed."""

    def program(self) -> "Callable[[], BoardProgram] | None":
        """Return what makes the program of a board; raises InputError for what is wrong with the image."""
        if find_spec("unicorn") is None:
            raise InputError(f"image={self.image}: the STM32F103's processor needs unicorn: {installing('m3')}")
        from steptwin.features.stm32.firmware import ImageProgram
        from steptwin.features.stm32.image import read_image
        from steptwin.features.stm32.kept_flash import check_flash
        from steptwin.features.stm32.serial_devices import SerialDevices

        assert self.image is not None
        chip = self.chip
        image = read_image(self.image, chip.offset, flash_kb=chip.flash_kb, ram_kb=chip.ram_kb)
        devices = SerialDevices(self.devices)
        flash = None if self.flash is None else Path(self.flash)
        if flash is not None:
            check_flash(flash, chip.flash_kb)
        return lambda: ImageProgram(image, chip, self.axes, self.compiled, flash, devices)
