"""The kernel in C: silent compilers, no undefined behaviour, and the arithmetic that C lacks."""

import ast
import ctypes
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.controller.motion.backend import Kernel
from steptwin.emulator.cortex_m3.image import WARNINGS
from steptwin.emulator.kernel_c.folder import kernel_files
from steptwin.emulator.kernel_c.source import kernel_source, width_of
from steptwin.emulator.kernel_c.translation import HELPERS
from steptwin.host.cli.app import run
from tests.emulator.kernel_c import native_kernel


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


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_compilers_are_silent(folder: Path, compiler: str) -> None:
    compiled(compiler, folder, "-O2", "-c", "main.c", "steptwin_kernel.c", "memory.c")


def test_the_example_runs(folder: Path) -> None:
    compiled("gcc", folder, "-O1", "main.c", "steptwin_kernel.c", "-o", "example")
    done = subprocess.run([folder / "example"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    edges = [line.split()[0] for line in done.stdout.splitlines()]
    assert (edges.count("CLK"), edges.count("DIR")) == (2 * 100 * 16, 2)


def played_under_the_sanitizer(folder: Path, source: str, seeds: range) -> "subprocess.CompletedProcess[str]":
    """Play scenarios on a source compiled with gcc's sanitizer, which ends the process at an undefined operation."""
    library = folder / f"{Path(source).stem}.so"
    sanitizer = ("-fsanitize=undefined", "-fno-sanitize-recover=all")
    compiled("gcc", folder, "-O1", "-shared", "-fPIC", *sanitizer, source, "-o", str(library))
    command = [sys.executable, "-m", native_kernel.__name__, str(library), str(seeds.start), str(seeds.stop)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_no_operation_is_undefined_in_random_scenarios(folder: Path, fast_kernel: Kernel) -> None:
    """The C of this machine also gives the kernel's bits, whole and tick by tick."""
    done = played_under_the_sanitizer(folder, "steptwin_kernel.c", range(100))
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == native_kernel.digest(fast_kernel, range(100))


def test_the_sanitizer_sees_an_overflow(folder: Path) -> None:
    """Scenario 0 has values at the limits of i32: the cubic's first product needs 64 bits."""
    source = (folder / "steptwin_kernel.c").read_text()
    assert source.count("(int64_t)c * s") == 1
    (folder / "narrow.c").write_text(source.replace("(int64_t)c * s", "c * s"))
    done = played_under_the_sanitizer(folder, "narrow.c", range(1))
    assert done.returncode != 0
    assert "signed integer overflow" in done.stderr


def test_the_files_say_what_the_kernel_says(folder: Path) -> None:
    assert {path.name for path in folder.iterdir()} >= set(kernel_files())
    header = (folder / "steptwin_kernel.h").read_text()
    body = (folder / "steptwin_kernel.c").read_text()
    assert "The sixteenth" in header or "the sixteenth prevents chatter" in header
    assert "Queue the cubic from the tail of the queue" in header  # a docstring of the interface
    assert "/* One call for each direction: the compiler inlines a version for each" in body  # a comment
    assert "| `st_axis` | 112 |" in (folder / "README.md").read_text()
    assert "{" not in (folder / "README.md").read_text()


def test_every_constant_of_the_kernel_is_in_the_header(folder: Path) -> None:
    """One that was not declared Final, say, would be left out."""
    lines = (folder / "steptwin_kernel.h").read_text().splitlines()
    defined = [found.group(1) for line in lines if (found := re.match(r"#define ST_(\w+) \S", line))]
    assert sorted(defined) == sorted(kernel_source().constants)


@pytest.mark.parametrize(
    ("annotation", "width"),
    [
        ("U17", "U17"),
        ("Annotated[int, U17]", "U17"),
        ("Final[Annotated[int, U17]]", "U17"),
        ("Final[I40]", "I40"),
        ("Final[Q30]", "Q30"),
        ("Final", None),
        ("Final[int]", None),
        ("Final[tuple[int, Cells]]", None),
        ("UNKNOWN", None),
    ],
)
def test_a_width_is_found_in_an_annotation(annotation: str, width: str | None) -> None:
    assert width_of(ast.parse(annotation, mode="eval").body) == width
    assert width_of(None) is None


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    """Return the helpers as a library of this machine."""
    made = tmp_path_factory.mktemp("division")
    text = "#include <stdint.h>\n" + (HELPERS["st_divide"] + HELPERS["st_floor_divide"]).replace("static ", "")
    declared = "uint64_t st_divide(uint64_t, uint32_t);\nint64_t st_floor_divide(int64_t, uint32_t);\n"
    (made / "division.c").write_text(text.replace("\n", f"\n{declared}", 1))
    compiled("gcc", made, "-O2", "-shared", "-fPIC", "division.c", "-o", "division.so")
    library = ctypes.CDLL(str(made / "division.so"))
    library.st_divide.argtypes, library.st_divide.restype = [ctypes.c_uint64, ctypes.c_uint32], ctypes.c_uint64
    library.st_floor_divide.argtypes = [ctypes.c_int64, ctypes.c_uint32]
    library.st_floor_divide.restype = ctypes.c_int64
    return library


NUMERATORS = st.one_of(st.integers(0, (1 << 64) - 1), st.sampled_from([0, (1 << 32) - 1, 1 << 32, 18_000 << 32]))
DIVISORS = st.one_of(
    st.integers(1, (1 << 32) - 1), st.integers(1, 1 << 21), st.sampled_from([(1 << 20) - 1, 1 << 20, (1 << 32) - 1])
)


@given(numerator=NUMERATORS, divisor=DIVISORS)
def test_divisions_against_python(library: ctypes.CDLL, numerator: int, divisor: int) -> None:
    assert library.st_divide(numerator, divisor) == numerator // divisor
    negative = -(numerator >> 2)
    assert library.st_floor_divide(negative, divisor) == negative // divisor
