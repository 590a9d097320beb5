"""Options of an emulated machine's firmware."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Final

from steptwin.host.common.errors import InputError
from steptwin.host.twin.machine.machine_options import SPELLING, Spelling

if TYPE_CHECKING:
    from steptwin.emulator.board.board_firmware import BoardProgram

_FIRMWARE: Final = Spelling(
    key="firmware",
    value="FILE",
    example='"build/fw.so"',
    says="Let each board run this firmware of yours, compiled for this computer (docs/firmware.md).",
    served=True,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class FirmwareOptions:
    """A library with a user's firmware for each board; None: our firmware."""

    firmware: Path | str | None = field(default=None, metadata={SPELLING: _FIRMWARE})

    def placed(self, folder: Path) -> "FirmwareOptions":
        """Return the options with the library's relative path resolved in a folder."""
        return self if self.firmware is None else FirmwareOptions(firmware=folder / self.firmware)

    def over(self, other: "FirmwareOptions") -> "FirmwareOptions":
        """Return `other`, with this object's library in place of its own if there is one."""
        return other if self.firmware is None else self

    def program(self) -> "Callable[[], BoardProgram] | None":
        """Return a function that makes a board's program; None for our own. Raise InputError without the file."""
        if self.firmware is None:
            return None
        path = Path(self.firmware)
        if not path.is_file():
            raise InputError(f"firmware={self.firmware}: is no file")
        from steptwin.features.firmware.native_firmware import NativeProgram

        return lambda: NativeProgram(path)
