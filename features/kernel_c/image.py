"""Compile the kernel for a Cortex-M3 with the system's cross compiler, as an image that a core can execute."""

import shutil
import subprocess
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from steptwin.features.kernel_c.layout import BODY, MEMORY_COPY, kernel_files

COMPILER: Final = "arm-none-eabi-gcc"
PACKAGE: Final = "gcc-arm-none-eabi"
"""The Debian package of the compiler."""
WARNINGS: Final = (
    "-std=c11",
    "-pedantic",
    "-Wall",
    "-Wextra",
    "-Wconversion",
    "-Wsign-conversion",
    "-Wshadow",
    "-Werror",
)
"""The kernel and everything beside it compile without one of these warnings."""
CORE_OPTIONS: Final = ("-mcpu=cortex-m3", "-mthumb", "-O2", "-ffreestanding", "-fno-common")
FLASH: Final = 0x0800_0000
"""Address of the flash of an STM32F1."""


class CompilerMissingError(Exception):
    """The cross compiler is not installed."""


@dataclass(frozen=True, slots=True)
class Image:
    """The kernel's code: what stands in flash from FLASH on.

    Attributes:
        code: the bytes, with the constants and what gcc's library adds.
        symbols: address of each function of the interface.
        listing: the disassembly, as objdump prints it.
    """

    code: bytes
    symbols: dict[str, int]
    listing: str


def build(files: dict[str, str]) -> Image:
    """Compile and link the kernel's files, texts by name.

    Raises:
        CompilerMissingError: the compiler is not installed.
        CalledProcessError: the source is wrong.
    """
    if shutil.which(COMPILER) is None:
        raise CompilerMissingError(f"{COMPILER} is not installed (apt-get install {PACKAGE})")
    with TemporaryDirectory() as name:
        folder = Path(name)
        for file, text in files.items():
            (folder / file).write_text(text, encoding="utf-8")
        layout = ("-nostdlib", f"-Wl,-Ttext={FLASH:#x}", "-Wl,--entry=st_advance")
        _run(folder, COMPILER, *WARNINGS, *CORE_OPTIONS, BODY, MEMORY_COPY, *layout, "-lgcc", "-o", "kernel.elf")
        _run(folder, "arm-none-eabi-objcopy", "-O", "binary", "-j", ".text", "-j", ".rodata", "kernel.elf", "code")
        symbols = [line.split() for line in _run(folder, "arm-none-eabi-nm", "kernel.elf").splitlines()]
        return Image(
            (folder / "code").read_bytes(),
            {name: int(address, 16) for address, _, name in symbols if name.startswith("st_")},
            _run(folder, "arm-none-eabi-objdump", "-d", "kernel.elf"),
        )


def compiler_version() -> str:
    """Return the version of the cross compiler, such as "12.2.1", on which the number of instructions depends."""
    return _run(Path(), COMPILER, "-dumpfullversion").strip()


@cache
def kernel_image() -> Image:
    """Build the kernel, once."""
    return build(kernel_files())


def _run(folder: Path, *command: str) -> str:
    return subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True).stdout
