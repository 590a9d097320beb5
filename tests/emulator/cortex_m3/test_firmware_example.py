"""The example firmware for an STM32F103: it builds, boots on an emulated core, and its edges are numba's."""

import shutil
import subprocess
from pathlib import Path

import pytest

from steptwin.controller import kernel as k
from steptwin.controller.backend import Kernel
from steptwin.emulator.cortex_m3.image import COMPILER
from steptwin.host.cli.app import run
from steptwin.protocol.objects import UNITS_PER_FULL_STEP
from tests.controller.kernel_rig import KernelRig

unicorn = pytest.importorskip("unicorn", reason="the extra `m3` (unicorn) is not installed")
if shutil.which(COMPILER) is None:
    pytest.skip(f"{COMPILER} is not installed", allow_module_level=True)

EXAMPLE = Path(__file__).parents[3] / "examples" / "stm32f103"
FLASH, RAM, RAM_BYTES = 0x0800_0000, 0x2000_0000, 20 << 10
PERIPHERALS = ((0x4000_0000, 0x3_0000), (0xE000_E000, 0x1000))
SERVO_VECTOR = 16 + 25
"""TIM1_UP's place in the vector table."""
RETURN_ADDRESS = FLASH + 0xFFF0
UNUSED = b"\xa5"
AXES, SEGMENTS, SEGMENT_TICKS = 7, 20, 200
TICKS = SEGMENTS * SEGMENT_TICKS + 4


class Board:
    """The firmware on a core with an F103's memories. Its peripherals are plain memory that keeps what is written."""

    def __init__(self, folder: Path) -> None:
        self._image = (folder / "firmware.bin").read_bytes()
        listed = subprocess.check_output(["arm-none-eabi-nm", folder / "firmware.elf"], text=True)
        self.symbols = {name: int(at, 16) for at, _, name in map(str.split, listed.splitlines())}
        self._core = unicorn.Uc(unicorn.UC_ARCH_ARM, unicorn.UC_MODE_THUMB | unicorn.UC_MODE_MCLASS)
        self._core.ctl_set_cpu_model(unicorn.arm_const.UC_CPU_ARM_CORTEX_M3)
        for address, size in ((FLASH, 64 << 10), (RAM, RAM_BYTES), *PERIPHERALS):
            self._core.mem_map(address, size)
        self._core.mem_write(FLASH, self._image)
        self._core.mem_write(RAM, UNUSED * RAM_BYTES)
        self._core.reg_write(unicorn.arm_const.UC_ARM_REG_SP, self._vector(0))
        self._core.emu_start(self._vector(1), RETURN_ADDRESS)  # up to main's WFI, which ends it

    def _vector(self, number: int) -> int:
        return int.from_bytes(self._image[4 * number : 4 * number + 4], "little")

    def servo_interrupt(self) -> None:
        """Run the handler of the servo timer."""
        self._core.reg_write(unicorn.arm_const.UC_ARM_REG_LR, RETURN_ADDRESS | 1)
        self._core.emu_start(self._vector(SERVO_VECTOR), RETURN_ADDRESS)

    def word(self, name: str) -> int:
        """Read a variable."""
        return int.from_bytes(self._core.mem_read(self.symbols[name], 4), "little")

    def stack_left(self) -> int:
        """Return the bytes between the variables and the deepest use of the stack."""
        end = self.symbols["bss_end"]
        above = bytes(self._core.mem_read(end, RAM + RAM_BYTES - end))
        return len(above) - len(above.lstrip(UNUSED))


@pytest.fixture(scope="module")
def board(tmp_path_factory: pytest.TempPathFactory) -> Board:
    """Return the example, built as its Makefile builds it, after all ticks of its motion."""
    folder = tmp_path_factory.mktemp("firmware") / "stm32f103"
    shutil.copytree(EXAMPLE, folder)
    assert run(["kernel-c", str(folder / "kernel")]) == 0
    made = subprocess.run(["make", "--silent"], cwd=folder, capture_output=True, text=True, check=False)
    assert (made.returncode, made.stderr) == (0, "")
    board = Board(folder)
    for _ in range(TICKS):
        board.servo_interrupt()
    return board


def test_its_edges_are_numbas(board: Board, fast_kernel: Kernel) -> None:
    edges, clk_edges = edges_of_the_motion(fast_kernel)
    expected = 2_166_136_261  # FNV-1a
    for edge in edges:
        expected = (expected ^ edge & 0xFFFF_FFFF) * 16_777_619 & 0xFFFF_FFFF
    assert clk_edges > 35_000
    assert (board.word("fault"), board.word("edge_count"), board.word("edge_hash")) == (0, clk_edges, expected)


def test_its_memory_fits(board: Board) -> None:
    """The linker asserts 768 bytes for the stack; an interrupt pushes 32 more than a call, and CAN will want some."""
    assert board.stack_left() >= 2_048


def edges_of_the_motion(kernel: Kernel) -> tuple[list[int], int]:
    """Return the motion of motion.h in the firmware's order: tick by tick, each axis' CLK and then its DIR edges.

    The second result is the number of CLK edges.
    """
    rig = KernelRig(kernel, AXES)
    rig.group[k.RATE_FROM_Q16] = k.FULL_RATE_Q16
    for axis in range(AXES):
        for segment in range(SEGMENTS):
            way = (axis + 1) * 2 * UNITS_PER_FULL_STEP + 77 * segment
            assert rig.push_ticks(way if segment % 2 == 0 else -way, 0, SEGMENT_TICKS, axis) == k.ACCEPTED
        rig.start(axis)
    edges: list[int] = []
    clk_edges = 0
    for _ in range(TICKS):
        rig.advance(1)
        for axis in range(AXES):
            clk_edges += rig.get(k.CLK_EDGES, axis)
            edges += [int(edge) for edge in rig.clk[axis][: rig.get(k.CLK_EDGES, axis)]]
            edges += [int(edge) for edge in rig.direction[axis][: rig.get(k.DIR_EDGES, axis)]]
            rig.set(k.CLK_EDGES, 0, axis)
            rig.set(k.DIR_EDGES, 0, axis)
    return edges, clk_edges
