"""Compile the kernel for a Cortex-M3 with the system's cross compiler, as an image that a core can execute."""

import shutil
import subprocess
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from steptwin.emulator.kernel_c.source import PUBLIC
from steptwin.emulator.kernel_c.translation import BODY, HEADER, CSource, translate

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
"""The translation and everything beside it compile without one of these warnings."""
CORE_OPTIONS: Final = ("-mcpu=cortex-m3", "-mthumb", "-O2", "-ffreestanding", "-ffunction-sections", "-fno-common")
FLASH: Final = 0x0800_0000
"""Address of the flash of an STM32F1."""
MEMORY_COPY: Final = "memory.c"
"""What gcc calls on its own: memcpy."""


class CompilerMissingError(Exception):
    """The cross compiler is not installed."""


@dataclass(frozen=True, slots=True)
class Image:
    """The kernel's code: what stands in flash from FLASH on.

    Attributes:
        code: the bytes.
        symbols: address of each function of the interface.
        listing: the disassembly, as objdump prints it.
        text_bytes: length of code and constants, with what gcc's library adds.
    """

    code: bytes
    symbols: dict[str, int]
    listing: str
    text_bytes: int


def build(source: CSource | None = None) -> Image:
    """Compile and link; raise CompilerMissingError without the compiler, CalledProcessError for wrong source."""
    if shutil.which(COMPILER) is None:
        raise CompilerMissingError(f"{COMPILER} is not installed (apt-get install {PACKAGE})")
    source = source or translate()
    with TemporaryDirectory() as folder:
        return _built(Path(folder), source)


def compiler_version() -> str:
    """Return the version of the cross compiler, such as "12.2.1", on which the number of instructions depends."""
    return _run(Path(), COMPILER, "-dumpfullversion").strip()


@cache
def kernel_image() -> Image:
    """Build the kernel that is imported, once."""
    return build()


def _built(folder: Path, source: CSource) -> Image:
    (folder / HEADER).write_text(source.header, encoding="utf-8")
    (folder / BODY).write_text(source.body, encoding="utf-8")
    (folder / MEMORY_COPY).write_text(memory_copy(), encoding="utf-8")
    kept = [f"-Wl,--undefined=st_{name}" for name in PUBLIC]
    layout = ("-nostdlib", f"-Wl,-Ttext={FLASH:#x}", "-Wl,--gc-sections", "-Wl,--entry=st_advance", *kept)
    _run(folder, COMPILER, *WARNINGS, *CORE_OPTIONS, BODY, MEMORY_COPY, *layout, "-lgcc", "-o", "kernel.elf")
    _run(folder, "arm-none-eabi-objcopy", "-O", "binary", "-j", ".text", "-j", ".rodata", "kernel.elf", "kernel.bin")
    symbols = {
        name: int(address, 16)
        for address, _, name in (line.split() for line in _run(folder, "arm-none-eabi-nm", "kernel.elf").splitlines())
        if name.startswith("st_")
    }
    code = (folder / "kernel.bin").read_bytes()
    return Image(code, symbols, _run(folder, "arm-none-eabi-objdump", "-d", "kernel.elf"), len(code))


def memory_copy() -> str:
    """Return the C text of memcpy for a core without a C library."""
    return (files("steptwin.emulator.kernel_c") / "parts" / MEMORY_COPY).read_text(encoding="utf-8")


def _run(folder: Path, *command: str) -> str:
    return subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True).stdout
