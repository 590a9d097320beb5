"""The kernel in C: silent compilers, no undefined behaviour, the kernel's constants and ranges, and its divisions."""

import ctypes
import re
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.controller.motion import kernel as k
from steptwin.controller.motion.backend import python_kernel
from steptwin.features.kernel_c.image import WARNINGS, CompilerMissingError
from steptwin.features.kernel_c.layout import BODY, HEADER, Layout, kernel_files
from steptwin.host.cli.app import run
from tests.features.kernel_c import native_kernel
from tests.features.kernel_c.scenarios import play, scenario
from tests.kernel_forms import FORMS, kernel_form
from tests.one_example import one_example

SEEDS: Final = range(120)
SOME: Final = (7, 33, 42, 47, 105, 109, 119)
"""Scenarios that have all events; each mutation of the C in cortex_m3 shows in two of them or more, but a refusal's."""
SOME_OR_THE_OTHERS: Final = pytest.mark.parametrize(
    "seeds",
    [
        pytest.param(SOME, id="some"),
        pytest.param(sorted(set(SEEDS) - set(SOME)), id="others", marks=pytest.mark.slow),
    ],
)
"""The scenarios of a cheap and of a slow test."""
WHOLE: Final = 1 << 20
"""More ticks than any scenario has: each phase is one call."""
STRUCTURES: Final = {
    "axis": ("", k.AXIS_FIELDS, 112),
    "segment": ("SEGMENT_", k.SEGMENT_FIELDS, 32),
    "group": ("", k.GROUP_FIELDS, 24),
}
"""What the names of the kernel's cells begin with, their number, and the structure's bytes, by its name."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder that `steptwin kernel-c` writes."""
    made = tmp_path_factory.mktemp("kernel")
    assert run(["kernel-c", str(made / "c")]) == 0
    return made / "c"


def compiled(compiler: str, folder: Path, *arguments: str) -> None:
    """Compile without a warning, or skip where the compiler is missing."""
    if shutil.which(compiler) is None:
        pytest.skip(f"{compiler} is not installed")
    done = subprocess.run([compiler, *WARNINGS, *arguments], cwd=folder, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.slow
@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_compilers_are_silent(folder: Path, compiler: str) -> None:
    assert {"-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Wsign-conversion", "-Werror"} <= set(WARNINGS)
    compiled(compiler, folder, "-O2", "-c", "main.c", "steptwin_kernel.c", "memory.c")


def test_the_example_runs(folder: Path) -> None:
    compiled("gcc", folder, "-O0", "main.c", "steptwin_kernel.c", "-o", "example")
    done = subprocess.run([folder / "example"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    edges = [line.split()[0] for line in done.stdout.splitlines()]
    assert (edges.count("CLK"), edges.count("DIR")) == (2 * 100 * 16, 2)


@cache
def of_plain_python(seed: int) -> tuple[object, ...]:
    """Return what the reference answers and places in a scenario."""
    return play(python_kernel(), scenario(seed), WHOLE)


@SOME_OR_THE_OTHERS
@pytest.mark.parametrize("name", [name for name in FORMS if name != "python"])
def test_random_scenarios_whole_and_tick_by_tick(name: str, seeds: Sequence[int]) -> None:
    """On this machine with gcc's sanitizer and all bounds checked, and on the emulated core."""
    events: set[int] = set()
    for seed in seeds:
        expected = of_plain_python(seed)
        assert play(kernel_form(name), scenario(seed), WHOLE) == expected
        assert play(kernel_form(name), scenario(seed), 1) == expected
        events |= {event for part in expected if isinstance(part, list) for _, _, event in part}
    assert events == {k.EVENT_FINISHED, k.EVENT_UNDERRUN, k.EVENT_LATE_STEP}  # the scenarios have all that there is


@pytest.mark.slow
@pytest.mark.parametrize(
    ("right", "wrong", "says"),
    [
        pytest.param("(int64_t)c * s", "c * s", "signed integer overflow", id="product"),
        pytest.param("quotient * 16384", "(quotient << 14)", "left shift of negative value", id="shift"),
        pytest.param("ST_ASSERT_BITS(q, 40)", "ST_ASSERT_BITS(q, 20)", "Assertion `", id="bound"),
    ],
)
def test_what_is_undefined_or_beyond_a_bound_is_seen(tmp_path: Path, right: str, wrong: str, says: str) -> None:
    assert kernel_files()[BODY].count(right) == 1
    (tmp_path / HEADER).write_text(kernel_files()[HEADER])
    (tmp_path / BODY).write_text(kernel_files()[BODY].replace(right, wrong))
    try:
        library = native_kernel.library(tmp_path / BODY, *native_kernel.CHECKED)
    except CompilerMissingError as missing:
        pytest.skip(str(missing))
    command = [sys.executable, "-m", native_kernel.__name__, str(library)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert says in done.stderr


def cells_of(structure: str) -> dict[str, int]:
    """Return the kernel's cell of each member."""
    return {name: getattr(k, STRUCTURES[structure][0] + name.upper()) for name in Layout(structure).type.names or ()}


def test_every_constant_of_the_kernel_is_in_the_header_with_its_value() -> None:
    cells = {STRUCTURES[structure][0] + name.upper() for structure in STRUCTURES for name in cells_of(structure)}
    constants = {
        name: value
        for name, value in vars(k).items()
        if name.isupper() and type(value) is int and name not in cells and not name.endswith("_FIELDS")
    }
    defined = re.findall(r"^#define ST_(\w+) (\S.*)$", kernel_files()[HEADER], re.MULTILINE)
    assert {name: int(re.sub(r"INT64_C|[()]", "", text)) for name, text in defined} == constants
    assert len(constants) == 22


@pytest.mark.parametrize("structure", STRUCTURES)
def test_every_cell_of_the_kernel_is_a_member(folder: Path, structure: str) -> None:
    _, fields, size = STRUCTURES[structure]
    assert sorted(cells_of(structure).values()) == list(range(fields))
    layout, cells, copied = Layout(structure), np.arange(fields), np.zeros(fields, np.int64)
    layout.unpack(layout.packed(cells), copied)
    assert copied.tolist() == cells.tolist()
    assert layout.size == size
    assert f"| `st_{structure}` | {size} |" in (folder / "README.md").read_text()
    assert f"sizeof(st_{structure}) == {size}" in (folder / BODY).read_text()


def bounds(structure: str) -> tuple[list[int], list[int]]:
    """Return the lowest and the highest value in the comment behind each member, in the order of the kernel's cells."""
    comment = re.compile(r"^ +\w+ (\w+); +/\* (-?)2?\^?(\d+) \.\. (2\^)?(\d+)( - 1)?[ ;]", re.MULTILINE)
    text = kernel_files()[HEADER].partition(f"}} st_{structure};")[0].rpartition("typedef struct {")[2]
    found = {
        name: (-(1 << int(low)) if negative else int(low), (1 << int(high)) - bool(less) if power else int(high))
        for name, negative, low, power, high, less in comment.findall(text)
    }
    low, high = zip(*(found[name] for name in sorted(found, key=cells_of(structure).__getitem__)), strict=True)
    return list(low), list(high)


def test_the_bounds_of_the_header_are_read() -> None:
    assert bounds("group") == ([0, 0, -(1 << 43), 0], [98_304, 98_304, (1 << 43) - 1, (1 << 17) - 1])
    low, high = bounds("axis")
    assert len(low) == k.AXIS_FIELDS
    assert (low[k.COUNTER], high[k.COUNTER]) == (-(1 << 31), k.I32_MAX)
    assert (low[k.MICROSTEPS], high[k.MICROSTEPS]) == (1, 256)


@SOME_OR_THE_OTHERS
def test_every_cell_keeps_the_range_in_its_members_comment(seeds: Sequence[int]) -> None:
    """In plain Python, where nothing overflows, before and after each tick of the scenarios."""
    limits = {structure: np.array(bounds(structure)) for structure in STRUCTURES}

    def check(structure: str, cells: list[int]) -> None:
        low, high = limits[structure]
        table = np.array(cells).reshape(-1, len(low))
        assert ((low <= table) & (table <= high)).all(), table

    def advance(axes: Any, before: Any, queue: Any, group: Any, *others: Any) -> tuple[int, int]:
        check("axis", axes)
        check("segment", queue)
        check("group", group)
        answer = python_kernel().advance(axes, before, queue, group, *others)
        check("axis", axes)
        return answer

    for seed in seeds:
        assert play(replace(python_kernel(), advance=advance), scenario(seed), 1) == of_plain_python(seed)


@pytest.fixture(scope="module")
def divisions(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    """Return the source's divisions as functions of this machine's C."""
    made = tmp_path_factory.mktemp("divisions")
    (made / HEADER).write_text(kernel_files()[HEADER])
    (made / BODY).write_text(kernel_files()[BODY])
    (made / "divisions.c").write_text(f"""
#include "{BODY}"
uint64_t divided(uint64_t n, uint32_t d) {{ return divide(n, d); }}
int64_t floor_divided(int64_t n, uint32_t d) {{ return floor_divide(n, d); }}
int32_t parameter_of(int32_t since_q16, int32_t n, int32_t *rest) {{ return parameter(since_q16, n, rest); }}
""")
    compiled("gcc", made, "-O2", "-shared", "-fPIC", "divisions.c", "-o", "divisions.so")
    library = ctypes.CDLL(str(made / "divisions.so"))
    library.divided.argtypes, library.divided.restype = [ctypes.c_uint64, ctypes.c_uint32], ctypes.c_uint64
    library.floor_divided.argtypes, library.floor_divided.restype = [ctypes.c_int64, ctypes.c_uint32], ctypes.c_int64
    return library


NUMERATORS = st.one_of(st.integers(0, (1 << 64) - 1), st.sampled_from([0, (1 << 32) - 1, 1 << 32, 18_000 << 32]))
DIVISORS = st.one_of(
    st.integers(1, (1 << 32) - 1), st.integers(1, 1 << 21), st.sampled_from([(1 << 20) - 1, 1 << 20, (1 << 32) - 1])
)


@pytest.mark.slow
@given(numerator=NUMERATORS, divisor=DIVISORS)
def test_divisions_against_python(divisions: ctypes.CDLL, numerator: int, divisor: int) -> None:
    assert divisions.divided(numerator, divisor) == numerator // divisor
    negative = -(numerator >> 2)
    assert divisions.floor_divided(negative, divisor) == negative // divisor


@pytest.mark.slow
@given(since_q16=st.integers(-k.FULL_RATE_Q16, 1020 << 16), n=st.integers(1, 1020))
def test_the_parameter_of_a_segment_against_python(divisions: ctypes.CDLL, since_q16: int, n: int) -> None:
    rest = ctypes.c_int32()
    since_q16 = min(since_q16, n << 16)
    assert (divisions.parameter_of(since_q16, n, ctypes.byref(rest)), rest.value) == divmod(since_q16 << 14, n)


@pytest.mark.parametrize("divisor", [1, 3, (1 << 20) - 1, 1 << 20, (1 << 32) - 1])
def test_some_divisions(divisions: ctypes.CDLL, divisor: int) -> None:
    for numerator in (0, divisor - 1, divisor, (1 << 32) - 1, 1 << 32, 18_000 << 32, (1 << 64) - 1):
        one_example(test_divisions_against_python, divisions, numerator, divisor)
    for since_q16 in (-k.FULL_RATE_Q16, -1, 0, 12_345_678):
        one_example(test_the_parameter_of_a_segment_against_python, divisions, since_q16, 1 + divisor % 1020)
