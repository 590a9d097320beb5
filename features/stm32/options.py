"""The image of an STM32F103 that the board of an emulated machine runs, and its pins."""

from collections.abc import Callable
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Final

from steptwin.host.common.errors import InputError
from steptwin.host.common.extras import installing
from steptwin.host.twin.machine.machine_options import SPELLING, Spelling

if TYPE_CHECKING:
    from steptwin.emulator.board.board_firmware import BoardProgram
    from steptwin.features.stm32.section import Stm32
    from steptwin.host.robots.robot import Robot

_IMAGE: Final = Spelling(
    key="image",
    value="FILE",
    example='"build/fw.elf"',
    says="Let the board run this image of an STM32F103, wired as [stm32] in the robot file says (docs/firmware.md).",
    served=True,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Stm32Options:
    """An image that the board runs instead of our firmware; None: ours. `fitted` adds what the robot file says."""

    image: Path | str | None = field(default=None, metadata={SPELLING: _IMAGE})

    def over(self, other: "Stm32Options") -> "Stm32Options":
        """Return other options, with those of these that are no defaults in place of theirs."""
        return other if self.image is None else self

    def fitted(self, robot: "Robot", folder: Path, *, compiled: bool | None = None) -> "Stm32Options":
        """Return the options of a robot's machine, with a relative path that begins at a folder.

        For `compiled` see `FittedOptions`.

        Raises:
            InputError: the robot's file has no table `[stm32]`.
        """
        if self.image is None:
            return self
        from steptwin.features.stm32.section import Stm32

        table = robot.sections.get("stm32")
        if not isinstance(table, Stm32):
            raise InputError(
                f"image={self.image}: {robot.name} has no table [stm32], which says which pins are wired to what"
            )
        return FittedOptions(
            image=folder / self.image,
            wiring=table,
            axes=tuple((axis.name, axis.transmission.microsteps) for axis in robot.axes),
            compiled=compiled,
        )

    def program(self) -> "Callable[[], BoardProgram] | None":
        """Return what makes the program of a board; None for our own."""
        if self.image is not None:
            raise InputError(f"image={self.image}: needs the robot's file: give the robot by a file with [stm32]")
        return None


@dataclass(frozen=True, slots=True, kw_only=True)
class FittedOptions(Stm32Options):
    """The same for one robot's machine: with its table `[stm32]`, and names and microsteps of its axes."""

    wiring: "Stm32"
    axes: tuple[tuple[str, int], ...]
    compiled: bool | None = None
    """True for the chip compiled by numba, False for plain Python, None for numba where it is installed."""

    def program(self) -> "Callable[[], BoardProgram] | None":
        """Return what makes the program of a board; raises InputError for what is wrong with the image."""
        if find_spec("unicorn") is None:
            raise InputError(f"image={self.image}: the STM32F103's processor needs unicorn: {installing('m3')}")
        from steptwin.features.stm32.firmware import ImageProgram
        from steptwin.features.stm32.image import read_image

        assert self.image is not None
        wiring = self.wiring
        image = read_image(self.image, wiring.offset, flash_kb=wiring.flash_kb, ram_kb=wiring.ram_kb)
        return lambda: ImageProgram(image, wiring, self.axes, self.compiled)
