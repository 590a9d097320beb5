"""What a firmware has programmed into its flash: kept from one power-up to the next, and in a file."""

from pathlib import Path

from steptwin.features.stm32.chip import cells as c
from steptwin.features.stm32.chip import flash
from steptwin.features.stm32.chip.engine import Stm32Chip
from steptwin.host.common.errors import InputError


class KeptFlash:
    """The content of a flash at the last power-down. A new image is flashed over it."""

    def __init__(self, path: Path | None = None) -> None:
        """Begin with the content of a file, if there is one; the flash is erased otherwise."""
        self._path = path
        self._content = path.read_bytes() if path is not None and path.exists() else b""
        self._changes = 0

    def power_up(self) -> tuple[tuple[int, bytes], ...]:
        """Return the content as what a new chip has before its image."""
        self._changes = 0
        return ((c.FLASH_START, self._content),) if self._content else ()

    def keep_if_locked(self, chip: Stm32Chip) -> None:
        """Keep what has been changed, once the firmware has locked the flash again."""
        if chip.cells[flash.BASE + flash.CR] & flash.LOCK:
            self.keep(chip)

    def keep(self, chip: Stm32Chip) -> None:
        """Keep the content, if the firmware has changed it."""
        changes = chip.cells[c.FLASH_WRITES] + chip.cells[c.FLASH_ERASES]
        if changes == self._changes:
            return
        self._changes, self._content = changes, chip.flash
        if self._path is not None:
            self._path.write_bytes(self._content)


def check_flash(path: Path, flash_kb: int) -> None:
    """Raise InputError unless a file can hold the content of a flash of this size."""
    try:
        size = path.stat().st_size if path.exists() else 1024 * flash_kb
        if not path.parent.is_dir() or path.is_dir():
            raise InputError(f"flash={path}: is no place for a file")
    except OSError as error:
        raise InputError(f"flash={path}: {error.strerror}") from error
    if size != 1024 * flash_kb:
        raise InputError(
            f"flash={path}: has {size} bytes; the flash has {1024 * flash_kb}: give a file of such a run, or a new one"
        )
