"""The file that is flashed: what is read, and what is refused with which sentence."""

import struct
from pathlib import Path

import pytest

from steptwin.features.stm32.image import read_image
from steptwin.host.common.errors import InputError
from tests.features.stm32.examples import EXAMPLES

_IMAGE = EXAMPLES / "compare_stepper.elf"


def _changed(tmp_path: Path, *changes: tuple[str, int, int]) -> Path:
    """Return a copy of an example's ELF with numbers in other places: format, offset, value."""
    content = bytearray(_IMAGE.read_bytes())
    for form, at, value in changes:
        struct.pack_into(form, content, at, value)
    path = tmp_path / "fw.elf"
    path.write_bytes(content)
    return path


def _raw(tmp_path: Path, *words: int) -> Path:
    path = tmp_path / "fw.bin"
    path.write_bytes(b"".join(word.to_bytes(4, "little") for word in words) + bytes(64))
    return path


def test_an_elf_has_segments_functions_and_lines() -> None:
    image = read_image(_IMAGE)
    assert image.vectors == image.segments[0][0] == 0x08000000
    reset = int.from_bytes(image.segments[0][1][4:8], "little") - 1
    assert image.place(reset).startswith(f"0x{reset:08X} in reset (start.c:")
    assert image.place(image.address_of("tim2") + 2).split(" (")[0].endswith("in tim2+2")
    assert image.address_of("nothing") == 0
    assert image.place(0x20000000) == "0x20000000"


def test_a_bin_begins_where_the_offset_says(tmp_path: Path) -> None:
    image = read_image(_raw(tmp_path, 0x20005000, 0x08002101), 0x2000)
    assert (image.vectors, image.segments[0][0]) == (0x08002000, 0x08002000)


def _refused(path: Path, offset: int = 0, **sizes: int) -> str:
    with pytest.raises(InputError) as caught:
        read_image(path, offset, **sizes)
    return str(caught.value).removeprefix(f"{path}: ")


def test_a_file_that_is_no_image_is_refused(tmp_path: Path) -> None:
    (path := tmp_path / "fw.hex").write_text(":00000001FF")
    assert _refused(path) == "is no ELF, and its name does not end in .bin: give the file that is flashed"
    assert _refused(tmp_path / "none.elf") == "cannot be read: No such file or directory"
    (path := tmp_path / "half.elf").write_bytes(_IMAGE.read_bytes()[:40])
    assert _refused(path).startswith("is a broken ELF: ")


def test_an_elf_of_another_machine_is_refused(tmp_path: Path) -> None:
    path = _changed(tmp_path, ("<H", 18, 62))
    assert _refused(path) == "is for X86_64: an STM32F103 needs ARM, 32 bits"
    path = _changed(tmp_path, ("<H", 16, 1))
    assert _refused(path) == "is not linked (ET_REL): give the file that is flashed"


def test_a_section_outside_the_flash_is_refused(tmp_path: Path) -> None:
    headers = struct.unpack_from("<I", _IMAGE.read_bytes(), 28)[0]
    path = _changed(tmp_path, ("<I", headers + 12, 0x08100000))
    assert _refused(path).endswith("is outside the flash, 0x08000000 to 0x08020000; flash_kb in [stm32] sets its size")


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (
            (0xFFFFFFFF, 0x08000101),
            "its stack pointer 0xFFFFFFFF is not in the RAM, 0x20000000 to 0x20005000; ram_kb in [stm32] sets its size",
        ),
        (
            (0x20005004, 0x08000101),
            "its stack pointer 0x20005004 is not in the RAM, 0x20000000 to 0x20005000; ram_kb in [stm32] sets its size",
        ),
        ((0x20005000, 0x08000100), "its reset vector 0x08000100 is no Thumb code in the flash"),
        ((0x20005000, 0x20000101), "its reset vector 0x20000101 is no Thumb code in the flash"),
    ],
)
def test_a_file_without_a_vector_table_is_refused(tmp_path: Path, words: tuple[int, int], sentence: str) -> None:
    assert _refused(_raw(tmp_path, *words)) == f"has no vector table at 0x08000000: {sentence}"


def test_an_offset_where_no_table_can_stand_is_refused(tmp_path: Path) -> None:
    path = _raw(tmp_path, 0x20005000, 0x08000101)
    expected = "offset 100: is no multiple of 128 from 0 to 130944, where programs begin"
    assert _refused(path, 100) == expected
