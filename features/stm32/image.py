"""Read the file that is flashed: an ELF of arm-none-eabi-gcc and the like, or a raw .bin."""

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from steptwin.host.common.bad_input import unknown
from steptwin.host.common.errors import InputError
from steptwin.host.common.extras import installing

if TYPE_CHECKING:
    from elftools.elf.elffile import ELFFile

FLASH_START: Final = 0x08000000
RAM_START: Final = 0x20000000
FLASH_KB_MAX, RAM_KB_MAX = 512, 64
_BYTES_MAX: Final = 64 << 20
"""Largest file, with what a debugger wants to know."""
_VECTORS: Final = 16
_ALIGNED: Final = 128
"""Bytes at whose multiples a vector table can stand (PM0056, 4.4.4)."""


@dataclass(frozen=True, slots=True)
class FlashImage:
    """What is flashed, and what is known of its functions.

    Attributes:
        path: the file.
        segments: addresses in flash, and what stands there.
        vectors: address of the vector table.
        functions: addresses, ends and names of functions, sorted.
        variables: addresses, ends and names of variables in RAM, sorted.
        lines: addresses, files and lines of the source, sorted.
    """

    path: Path
    segments: tuple[tuple[int, bytes], ...]
    vectors: int
    functions: tuple[tuple[int, int, str], ...] = ()
    variables: tuple[tuple[int, int, str], ...] = ()
    lines: tuple[tuple[int, str, int], ...] = field(default=(), repr=False)

    @property
    def data_end(self) -> int:
        """Where the variables below the main stack end, as far as they are known."""
        stack = int.from_bytes(_content_at(self.segments, self.vectors, 4) or b"", "little")
        return max((end + 3 & ~3 for _, end, _ in self.variables if end < stack), default=RAM_START)

    def variable(self, name: str) -> tuple[int, int]:
        """Return the address and the size of a variable.

        Raises:
            InputError: there is none of this name, or there are several.
        """
        found = [(begin, end - begin) for begin, end, each in self.variables if each == name]
        if len(found) > 1:
            raise InputError(f"{name}: {self.path} has {len(found)} variables of this name")
        if not found:
            raise unknown("variable", name, [each for _, _, each in self.variables])
        return found[0]

    def address_of(self, name: str) -> int:
        """Return the address of a function; 0 if it is not known."""
        return next((begin for begin, _, each in self.functions if each == name), 0)

    def place(self, pc: int) -> str:
        """Return where an instruction is: its address, function and source line, as far as they are known."""
        text = f"0x{pc:08X}"
        number = bisect_right(self.functions, (pc, 1 << 32, "")) - 1
        if number >= 0 and pc < self.functions[number][1]:
            begin, _, name = self.functions[number]
            text += f" in {name}" + (f"+{pc - begin}" if pc > begin else "")
        number = bisect_right(self.lines, (pc, "\uffff", 0)) - 1
        if number >= 0 and self.lines[number][2]:
            text += f" ({self.lines[number][1]}:{self.lines[number][2]})"
        return text


def read_image(path: Path | str, offset: int = 0, *, flash_kb: int = 128, ram_kb: int = 20) -> FlashImage:
    """Return what a file holds for a chip with so much flash and RAM.

    Args:
        path: an ELF, or a raw .bin.
        offset: where a .bin or the program of an ELF begins in the flash, behind a bootloader that is not there.
        flash_kb: size of the flash.
        ram_kb: size of the RAM.

    Raises:
        InputError: the file is neither, or is not for a Cortex-M3, or does not fit, or has no vector table.
    """
    path = Path(path)
    try:
        if path.stat().st_size > _BYTES_MAX:
            raise InputError(f"{path}: has {path.stat().st_size} bytes; an image has at most {_BYTES_MAX}")
        content = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error
    if offset % _ALIGNED or not 0 <= offset < 1024 * flash_kb:
        raise InputError(
            f"offset {offset}: is no multiple of {_ALIGNED} from 0 to {1024 * flash_kb - _ALIGNED},"
            " where programs begin"
        )
    if content[:4] == b"\x7fELF":
        image = _read_elf(path, offset)
    elif path.suffix.lower() == ".bin":
        image = FlashImage(path, ((FLASH_START + offset, content),), FLASH_START + offset)
    else:
        raise InputError(f"{path}: is no ELF, and its name does not end in .bin: give the file that is flashed")
    _check_places(image, flash_kb)
    _check_vectors(image, flash_kb, ram_kb)
    return image


def _read_elf(path: Path, offset: int) -> FlashImage:
    try:
        from elftools.common.exceptions import DWARFError, ELFError
        from elftools.elf.elffile import ELFFile
    except ModuleNotFoundError as error:
        raise InputError(f"{path}: reading an ELF needs pyelftools: {installing('m3')}") from error
    try:
        with path.open("rb") as file:
            elf = ELFFile(file)
            _check_machine(path, elf)
            segments = tuple(
                (int(each["p_paddr"]), each.data())
                for each in elf.iter_segments("PT_LOAD")
                if each["p_filesz"] and not RAM_START <= each["p_paddr"] < RAM_START + 1024 * RAM_KB_MAX
            )
            vectors = min((address for address, _ in segments), default=FLASH_START) if not offset else 0
            functions = tuple(sorted(_symbols(elf, "STT_FUNC")))
            variables = tuple(each for each in sorted(_symbols(elf, "STT_OBJECT")) if each[0] >= RAM_START)
            try:
                lines = tuple(sorted(_lines(elf)))
            except (DWARFError, ELFError, KeyError, ValueError, AttributeError):
                lines = ()  # a debugger's part that this reader does not understand
            return FlashImage(path, segments, vectors or FLASH_START + offset, functions, variables, lines)
    except ELFError as error:
        raise InputError(f"{path}: is a broken ELF: {error}") from error


def _check_machine(path: Path, elf: "ELFFile") -> None:
    machine = elf["e_machine"]
    if machine != "EM_ARM" or elf.elfclass != 32 or not elf.little_endian:
        raise InputError(f"{path}: is for {str(machine).removeprefix('EM_')}: an STM32F103 needs ARM, 32 bits")
    if elf["e_type"] != "ET_EXEC":
        raise InputError(f"{path}: is not linked ({elf['e_type']}): give the file that is flashed")
    attributes: Any = elf.get_section_by_name(".ARM.attributes")
    if attributes is None:
        return
    found = {
        each.tag: each.value
        for part in attributes.iter_subsections()
        for subpart in part.iter_subsubsections()
        for each in subpart.iter_attributes()
    }
    architecture, core = found.get("TAG_CPU_ARCH"), found.get("TAG_CPU_NAME")
    if architecture not in (None, *_ARCHITECTURES):
        raise InputError(f"{path}: is for the ARM core {core or architecture}: an STM32F103 has a Cortex-M3")


_ARCHITECTURES: Final = (10, 11, 12)
"""v7, v6-M and v6S-M, whose instructions a Cortex-M3 has; 13, v7E-M, is that of the Cortex-M4."""


def _symbols(elf: "ELFFile", kind: str) -> Iterator[tuple[int, int, str]]:
    """Yield begin, end and name of functions or variables; a function has at least an instruction."""
    table: Any = elf.get_section_by_name(".symtab")
    for symbol in table.iter_symbols() if table is not None else ():
        if symbol["st_info"]["type"] == kind:
            is_code = kind == "STT_FUNC"
            begin = int(symbol["st_value"]) & (~1 if is_code else ~0)
            yield begin, begin + max(int(symbol["st_size"]), 2 if is_code else 0), symbol.name


def _lines(elf: "ELFFile") -> Iterator[tuple[int, str, int]]:
    """Yield where the code of each line begins; line 0 is where a stretch of code ends."""
    if not elf.has_dwarf_info():
        return
    info: Any = elf.get_dwarf_info()
    for unit in info.iter_CUs():
        program = info.line_program_for_CU(unit)
        if program is None:
            continue
        files, first = program["file_entry"], 0 if program["version"] >= 5 else 1
        for entry in program.get_entries():
            state = entry.state
            if state is None:
                continue
            place = state.file - first
            name = files[place].name.decode(errors="replace") if 0 <= place < len(files) else "?"
            yield state.address, name, 0 if state.end_sequence else state.line


def _check_places(image: FlashImage, flash_kb: int) -> None:
    if not image.segments:
        raise InputError(f"{image.path}: has nothing to flash")
    for address, content in image.segments:
        end = address + len(content)
        if not FLASH_START <= address <= end <= FLASH_START + 1024 * flash_kb:
            raise InputError(
                f"{image.path}: 0x{address:08X} to 0x{end:08X} is outside the flash,"
                f" 0x{FLASH_START:08X} to 0x{FLASH_START + 1024 * flash_kb:08X}; flash_kb in [stm32] sets its size"
            )


def _check_vectors(image: FlashImage, flash_kb: int, ram_kb: int) -> None:
    """Raise InputError unless stack pointer and reset vector are such that a processor can begin."""
    table = _content_at(image.segments, image.vectors, 4 * _VECTORS)
    ram_end = RAM_START + 1024 * ram_kb
    if table is None:
        raise InputError(f"{image.path}: has no vector table at 0x{image.vectors:08X}: nothing stands there")
    stack, reset = (int.from_bytes(table[at : at + 4], "little") for at in (0, 4))
    if not RAM_START < stack <= ram_end or stack % 4:
        raise InputError(
            f"{image.path}: has no vector table at 0x{image.vectors:08X}: its stack pointer 0x{stack:08X} is not in"
            f" the RAM, 0x{RAM_START:08X} to 0x{ram_end:08X}; ram_kb in [stm32] sets its size"
        )
    if not reset & 1 or not FLASH_START <= reset < FLASH_START + 1024 * flash_kb:
        raise InputError(
            f"{image.path}: has no vector table at 0x{image.vectors:08X}: its reset vector 0x{reset:08X} is no"
            " Thumb code in the flash"
        )


def _content_at(segments: Sequence[tuple[int, bytes]], address: int, size: int) -> bytes | None:
    for begin, content in segments:
        if begin <= address <= begin + len(content) - size:
            return content[address - begin : address - begin + size]
    return None
