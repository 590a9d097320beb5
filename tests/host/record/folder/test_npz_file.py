"""edges.npz may hold anything: it is read, or refused in one line, and no memory is taken for what it only declares."""

import contextlib
import io
import random
import struct
import tracemalloc
import zipfile
from pathlib import Path
from typing import Any, Final

import numpy as np
import pytest
from numpy.typing import NDArray

from steptwin.host.common.errors import InputError
from steptwin.host.common.file_limits import ARRAYS_BYTES_FREE, ARRAYS_BYTES_MAX, ARRAYS_RATIO_MAX, GIB, MIB
from steptwin.host.record.folder import ContradictionError, read_edges
from steptwin.host.record.folder.edges_file import write_edges
from steptwin.host.record.folder.npz_file import INSTANT_MAX, opened_npz
from tests.host.complaints import complaint_of
from tests.host.record.folder.stored import EVIDENCE, arrays_of, assert_same

FLAGS, METHOD, VERSION, PACKED, SIZE = 8, 10, 6, 20, 24
"""Places of these fields in an entry of an archive's directory (APPNOTE 4.3.12)."""


def npy(kind: str, shape: str, values: bytes, version: bytes = b"\x01\x00") -> bytes:
    """Return an .npy file with any description."""
    description = f"{{'descr': {kind}, 'fortran_order': False, 'shape': {shape}, }}\n".encode("latin-1")
    return b"\x93NUMPY" + version + struct.pack("<H", len(description)) + description + values


def archive(path: Path, **members: bytes) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        for key, content in members.items():
            file.writestr(f"{key}.npy", content)
    return path


def patched(path: Path, place: int, value: bytes) -> Path:
    """Change a field of the first entry of an archive's directory."""
    data = bytearray(path.read_bytes())
    with zipfile.ZipFile(path) as file:
        begin = file.start_dir + place
    data[begin : begin + len(value)] = value
    path.write_bytes(data)
    return path


def read(path: Path, key: str = "x") -> NDArray[Any]:
    with opened_npz(path) as stored:
        return stored.array(key)


@pytest.mark.parametrize(
    "values",
    [
        np.arange(5, dtype=np.int8), np.arange(5, dtype=">i4"), np.arange(3, dtype=np.int64), np.array(7),
        np.empty(0, np.int16), np.array([1.5, np.inf]), np.arange(6).reshape(2, 3), np.array(["a", "θ₁\U0001f916"]),
        np.array("rising"), np.array([], np.str_), np.array(["ä"], ">U3"), np.array([True, False]),
    ],
    ids=lambda values: f"{values.dtype.str}{values.shape}",
)  # fmt: skip
def test_an_array_reads_as_numpy_wrote_it(values: NDArray[Any], tmp_path: Path) -> None:
    np.savez_compressed(tmp_path / "x.npz", x=values)
    again = read(tmp_path / "x.npz")
    assert again.dtype == values.dtype
    np.testing.assert_array_equal(again, values)


INT = "'<i8'"

DESCRIPTIONS: Final = {
    "objects": (npy("'|O'", "(1,)", b"12345678"), "is not an array of whole numbers, floats or texts"),
    "a record": (npy("[('a', '<i8')]", "(1,)", b"12345678"), "is not an array of"),
    "complex": (npy("'<c8'", "(1,)", b"12345678"), "is not an array of"),
    "code": (npy(INT, "(__import__('os').abort(),)", b""), "is not an array of"),
    "parentheses": (npy(INT, "(" * 900, b""), "is not an array of"),
    "digits of another script": (npy(INT, "(\xb2,)", b""), "is not an array of"),
    "a negative length": (npy(INT, "(-1,)", b""), "is not an array of"),
    "texts of no character": (npy("'<U0'", "(9,)", b""), "is not an array of"),
    "a huge length": (npy(INT, "(4611686018427387904,)", b"12345678"), "is not an array of"),
    "a long length": (npy(INT, "(999999999999,)", b"12345678"), "its shape (999999999999,) of <i8 does not have the 8"),
    "a short length": (npy(INT, "(1,)", b"1234567890123456"), "its shape (1,) of <i8 does not have the 16 bytes"),
    "many dimensions": (npy(INT, f"({'0, ' * 70})", b""), "cannot be read: "),
    "a long description": (npy(INT, f"(1,){' ' * 1000}", b""), "its description has 10"),
    "version 2": (npy(INT, "(1,)", b"12345678", b"\x02\x00"), "has version 2.0 of numpy's format, not 1.0"),
    "no array": (b"junk", "is not a numpy array"),
    "nothing": (b"", "is not a numpy array"),
    "half a surrogate pair": (npy("'<U1'", "(1,)", b"\x00\xd8\x00\x00"), "contains numbers that are no characters"),
    "no character": (npy("'<U1'", "(1,)", b"\x00\x00\x11\x00"), "contains numbers that are no characters"),
    "no character, backwards": (npy("'>U1'", "(1,)", b"\x00\x11\x00\x00"), "contains numbers that are no characters"),
}  # fmt: skip


@pytest.mark.parametrize("what", DESCRIPTIONS)
def test_an_array_that_numpy_does_not_write_is_refused(what: str, tmp_path: Path) -> None:
    content, told = DESCRIPTIONS[what]
    assert complaint_of(lambda: read(archive(tmp_path / "x.npz", x=content))).startswith(told)


@pytest.mark.parametrize(
    ("place", "value"),
    [
        (FLAGS, b"\x01\x00"),
        (FLAGS, b"\x20\x00"),
        (FLAGS, b"\x40\x00"),
        (METHOD, b"\x0c\x00"),
        (METHOD, b"\x63\x00"),
        (METHOD, b"\x00\x00"),
        (VERSION, b"\x3f\x00"),
        (VERSION, b"\xff\x00"),
        (SIZE, struct.pack("<I", 100)),
        (PACKED, struct.pack("<I", 5)),
        (0, b"PK\x05\x06"),
    ],
)
def test_a_member_of_another_kind_is_refused(place: int, value: bytes, tmp_path: Path) -> None:
    path = archive(tmp_path / "x.npz", x=npy(INT, "(1,)", b"12345678"))
    complaint_of(lambda: read(patched(path, place, value)))


def test_a_damaged_value_is_found_by_the_checksum(tmp_path: Path) -> None:
    path = tmp_path / "x.npz"
    np.savez(path, x=np.arange(1000))
    data = bytearray(path.read_bytes())
    data[data.index(struct.pack("<q", 500))] ^= 1
    path.write_bytes(data)
    complaint_of(lambda: read(path))


def complaint_in_little_memory(path: Path) -> str:
    """Return the message with which a file is refused, before more memory is taken than for a directory."""
    tracemalloc.start()
    try:
        message = complaint_of(lambda: read(path))
        assert tracemalloc.get_traced_memory()[1] < 2 * MIB
    finally:
        tracemalloc.stop()
    return message


class TestSizes:
    """All are refused before memory is taken."""

    def test_above_the_absolute_limit(self, tmp_path: Path) -> None:
        """The five members declare 4 GiB - 2 each."""
        path = tmp_path / "x.npz"
        archive(path, **dict.fromkeys("abcde", b""))
        data = bytearray(path.read_bytes())
        with zipfile.ZipFile(path) as file:
            at = file.start_dir
        for _ in range(5):
            data[at + SIZE : at + SIZE + 4] = b"\xfe\xff\xff\xff"
            at = data.find(b"PK\x01\x02", at + 4)
        path.write_bytes(data)
        assert ARRAYS_BYTES_MAX == 16 * GIB
        assert complaint_in_little_memory(path) == "its arrays have 20 GiB, more than 16 GiB"

    def test_above_the_limit_for_the_size_of_the_file(self, tmp_path: Path) -> None:
        """Zeros compress a thousandfold."""
        path = archive(tmp_path / "x.npz", x=npy(INT, f"({3 * MIB},)", bytes(24 * MIB)))
        assert path.stat().st_size < MIB
        message = complaint_in_little_memory(path)
        assert message.startswith("its arrays have 24 MiB, ")
        assert message.endswith(" KiB of the file: no recording has more than 100 times")

    def test_on_both_sides_of_the_limit_for_small_files(self, tmp_path: Path) -> None:
        path = archive(tmp_path / "x.npz", x=bytes(100))
        assert path.stat().st_size * ARRAYS_RATIO_MAX < ARRAYS_BYTES_FREE
        both = (ARRAYS_BYTES_FREE, "is not a numpy array"), (ARRAYS_BYTES_FREE + 1, "its arrays have 16 MiB")
        for size, told in both:
            patched(path, SIZE, struct.pack("<I", size))
            assert complaint_of(lambda: read(path)).startswith(told)

    def test_of_a_directory(self, tmp_path: Path) -> None:
        """A directory of 800 entries with long names is 1.2 MB long; it is not read."""
        path = tmp_path / "x.npz"
        with zipfile.ZipFile(path, "w") as file:
            for i in range(800):
                file.writestr(f"{i:01500d}.npy", b"")
        assert complaint_in_little_memory(path) == "cannot be read: its directory has more than 1 MiB"


def changed(tmp_path: Path, **arrays: object) -> ContradictionError:
    write_edges(tmp_path / "edges.npz", EVIDENCE)
    np.savez(tmp_path / "edges.npz", **{**arrays_of(tmp_path / "edges.npz"), **arrays})
    with pytest.raises(ContradictionError) as caught:
        read_edges(tmp_path)
    return caught.value


@pytest.mark.parametrize(
    ("arrays", "told"),
    [
        ({"a_start_steps": np.int64(1 << 62)}, f"a_start_steps: {1 << 62} is beyond -2147483648..2147483647"),
        ({"a_start_steps": np.int64(1 << 31)}, "a_start_steps: 2147483648 is beyond"),
        ({"start_counts": np.int64(-1)}, f"start_counts: -1 is beyond 0..{INSTANT_MAX}"),
        ({"start_counts": np.int64(INSTANT_MAX + 1)}, f"start_counts: {INSTANT_MAX + 1} is beyond"),
        ({"a_out1_counts": np.array([1 << 62])}, f"a_out1_counts: goes up to {1 << 62} counts, beyond {INSTANT_MAX}"),
        ({"a_out1_counts": np.array([(1 << 63) - 1, -5])}, "a_out1_counts: the instants are not in order of time"),
        ({"axes": np.array([], np.str_)}, "axes: has 0 names, not 1 to 8 different ones"),
        ({"axes": np.array(["a", "a"])}, "axes: has 2 names, not 1 to 8 different ones"),
        ({"axes": np.array([*"abcdefghi"])}, "axes: has 9 names, not 1 to 8 different ones"),
    ],
)  # fmt: skip
def test_values_beyond_any_recording_contradict(arrays: dict[str, object], told: str, tmp_path: Path) -> None:
    assert told in str(changed(tmp_path, **arrays))


def test_values_at_their_limits_are_read(tmp_path: Path) -> None:
    write_edges(tmp_path / "edges.npz", EVIDENCE)
    arrays = arrays_of(tmp_path / "edges.npz")
    arrays |= {"a_start_steps": np.int64(-(1 << 31)), "a_out1_counts": np.array([INSTANT_MAX])}
    np.savez(tmp_path / "edges.npz", **arrays | {"a_out1_levels": np.array([1])})
    axis = read_edges(tmp_path).axes[0]
    assert (axis.start_steps, axis.last_counts) == (-(1 << 31), INSTANT_MAX)


def structure(data: bytes) -> list[int]:
    """Return the places of all bytes of an archive that are not compressed values."""
    places: set[int] = set()
    with zipfile.ZipFile(io.BytesIO(data)) as file:
        for member in file.infolist():
            name_bytes, extra_bytes = struct.unpack_from("<HH", data, member.header_offset + 26)
            places |= set(range(member.header_offset, member.header_offset + 30 + name_bytes + extra_bytes))
        places |= set(range(file.start_dir, len(data)))
    return sorted(places)


@pytest.mark.parametrize(
    ("seed", "rounds"), [*(pytest.param(seed, 250, marks=pytest.mark.slow) for seed in range(2)), (2, 25)]
)
def test_a_damaged_archive_is_read_or_refused(seed: int, rounds: int, tmp_path: Path) -> None:
    """One to four bytes of the archive's structure are replaced, some by a flip of one bit."""
    chance = random.Random(seed)
    path = tmp_path / "edges.npz"
    write_edges(path, EVIDENCE)
    data = path.read_bytes()
    places = structure(data)
    outcomes = set()
    for _ in range(rounds):
        damaged = bytearray(data)
        for place in chance.sample(places, chance.choice((1, 1, 2, 4))):
            damaged[place] = chance.choice((damaged[place] ^ 1 << chance.randrange(8), chance.randrange(256), 0, 255))
        path.write_bytes(damaged)
        outcomes.add(message_of(tmp_path) is None)
    assert outcomes == {True, False}


def message_of(folder: Path) -> str | None:
    """Return the message with which edges.npz is refused, in one line; None if it is read as it was written."""
    try:
        evidence = read_edges(folder)
    except InputError as error:
        message = str(error)
    else:
        assert_same(evidence, EVIDENCE)
        return None
    assert len(message.splitlines()) == 1
    return message


EXTREMES: Final = (0, 1, -1, 127, -128, 32767, 1 << 31, INSTANT_MAX + 1, 1 << 62, (1 << 63) - 1, -(1 << 63))


@pytest.mark.parametrize(
    ("seed", "rounds"), [*(pytest.param(seed, 150, marks=pytest.mark.slow) for seed in range(2)), (2, 15)]
)
def test_a_damaged_array_is_read_or_refused(seed: int, rounds: int, tmp_path: Path) -> None:
    """The archive is whole; a description has flipped bits, or an array other values, another type or length."""
    chance = random.Random(seed)
    write_edges(tmp_path / "edges.npz", EVIDENCE)
    arrays = arrays_of(tmp_path / "edges.npz")
    whole = {key: encoded(values) for key, values in arrays.items()}
    for _ in range(rounds):
        key = chance.choice([*arrays])
        content = bytearray(encoded(damaged_array(chance, arrays[key])))
        if chance.random() < 0.5:
            content[chance.randrange(min(len(content), 128))] ^= 1 << chance.randrange(8)
        archive(tmp_path / "edges.npz", **whole | {key: bytes(content)})
        with contextlib.suppress(InputError):
            read_edges(tmp_path)


def damaged_array(chance: random.Random, values: NDArray[Any]) -> NDArray[Any]:
    kind = chance.randrange(4)
    if kind == 0 and values.ndim:
        return values[: chance.randrange(values.size + 1)]
    if kind == 1 and values.dtype.kind != "U":
        return values.astype(chance.choice(["<i8", ">i2", "|i1", "<f8", "|b1", "<u8"]))
    if kind == 2 and values.dtype.kind == "i" and values.size:
        values = values.astype(np.int64)
        values[chance.randrange(values.size) if values.ndim else ()] = chance.choice(EXTREMES)
    if values.dtype.kind == "U":
        return np.array([chance.choice(["", "a", "$x^$", "\x1b[31m", "b" * 300])] * chance.randrange(1, 10))
    return values


def encoded(values: NDArray[Any]) -> bytes:
    content = io.BytesIO()
    np.lib.format.write_array(content, np.asarray(values))
    return content.getvalue()
