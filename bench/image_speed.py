"""Measure how fast images of an STM32F103 run: simulated time over processor time, of their chip and of whole runs."""

import shutil
import subprocess
import time
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Final

from rich.table import Table

from steptwin.bench import bench_table
from steptwin.features.stm32.chip.engine import Stm32Chip
from steptwin.features.stm32.image import read_image
from steptwin.features.stm32.running import RunPlan, run_image
from steptwin.host.robots import load_robot
from steptwin.protocol.timer import COUNTS_PER_SECOND

_EXAMPLES: Final = Path(__file__).resolve().parents[1] / "examples" / "stm32-image"
_COMPILER: Final = "arm-none-eabi-gcc"
_IMAGES: Final = {
    "four axes at 10 kHz by compare, main sleeps": (),
    "the same, main polls": ("-DPOLL",),
    "one axis at 2 kHz by SysTick, main sleeps": ("-DSYSTICK",),
}
_REPEATS: Final = 5
_SECONDS: Final = {True: 2.0, False: 0.05}
"""Simulated time, of the compiled chip and of plain Python."""


def image_tables() -> Iterator[Table | str]:
    """Yield the tables, or why there are none."""
    if shutil.which(_COMPILER) is None:
        yield f"No images: {_COMPILER} is not installed"
        return
    forms = (True, False) if find_spec("numba") else (False,)
    with TemporaryDirectory() as folder:
        rows = []
        for title, macros in _IMAGES.items():
            path = _built(Path(folder) / "fw.elf", macros)
            factors = [f"{_factor(path, compiled=compiled):.3g}" for compiled in forms]
            rows.append("|".join([title, *factors]))
        headings = "|".join(["image", *("numba" if compiled else "plain Python" for compiled in forms)])
        yield bench_table(f"Images: simulated over processor time of the chip, median of {_REPEATS}", headings, rows)
    example, robot = _EXAMPLES / "compare_stepper.elf", load_robot(str(_EXAMPLES / "two-axes.toml"))
    run_image(example, robot, RunPlan(for_s=0.01))
    begun_s = time.process_time()
    run = run_image(example, robot, RunPlan(for_s=10.0, until_text="done"))
    spent_s = time.process_time() - begun_s
    yield f"compare_stepper.elf to its end, with drivers and verdict: {run.simulated_s:.3g} s in {spent_s:.3g} s"


def _built(path: Path, macros: tuple[str, ...]) -> Path:
    command = [_COMPILER, "-mcpu=cortex-m3", "-mthumb", "-O2", "-ffreestanding", "-fno-tree-loop-distribute-patterns"]
    sources = [str(_EXAMPLES / "start.c"), str(Path(__file__).with_name("stm32_images.c"))]
    link = ["-nostdlib", f"-Wl,-T,{_EXAMPLES / 'stm32f103.ld'}", "-lgcc", "-o", str(path)]
    subprocess.run([*command, *macros, f"-I{_EXAMPLES}", *sources, *link], check=True)
    return path


def _factor(path: Path, *, compiled: bool) -> float:
    """Return the real-time factor of a chip with its pins watched, after a hundredth of a second to warm up."""
    image = read_image(path)
    factors = []
    for _ in range(_REPEATS):
        chip = Stm32Chip(image.segments, image.vectors, main=image.address_of("main"), compiled=compiled)
        for pin in range(16):
            chip.watch(pin, released=False)
        _run(chip, 0.01)
        begun_s = time.process_time()
        _run(chip, _SECONDS[compiled])
        factors.append(_SECONDS[compiled] / (time.process_time() - begun_s))
        chip.close()
    return median(factors)


def _run(chip: Stm32Chip, seconds: float) -> None:
    end_counts = chip.now_counts + round(seconds * COUNTS_PER_SECOND)
    while chip.now_counts < end_counts:
        chip.run(end_counts)
        chip.take_edges()
