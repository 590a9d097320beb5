"""Print the tables of all benchmarks: `python -m steptwin.bench`, or `make bench`.

A word prints only some of them: `timing` those of the kernel's step timing beside a DDA, Bresenham and Austin's ramp,
`kinematics` those of poses and joints, `programs` those of a six-axis arm's programs,
`fastest` those of motions as fast as the limits allow, `beside-others` the same beside toppra and a look-ahead,
`motor-limited` those of motions as fast as the motors manage,
`package` those of the wheel's size and of start-up, `panel` those of the operator's panel, `motors` those of motors
after a run, `live-motors [PAIRS]` those of motors that turn with a live board, `workers` that of a campaign's workers,
`firmware` those of a user's own firmware, `images` those of images for the STM32F103, and `live` those of a live board,
with a stream of a minute and a million frames.
"""

import os
import platform
import sys
from collections.abc import Callable, Iterable, Iterator
from importlib.util import find_spec
from typing import Final

from rich.console import Console
from rich.table import Table

from steptwin.bench.bulk_speed import driver_table, kinematics_table, rotor_table, waveform_table
from steptwin.bench.drawer_pull import compiled_text, drawer_pull_table, workers_table
from steptwin.bench.fastest_motions import corners_text, gcode_table, motions_table, motor_limited_table, random_text
from steptwin.bench.image_speed import image_tables
from steptwin.bench.kernel_speed import cyclic_table, kernel_table, scaling_tables, timing_table
from steptwin.bench.live_board import live_motors_table, live_tables
from steptwin.bench.own_firmware import firmware_tables
from steptwin.bench.package_size import package_tables
from steptwin.bench.panel_delays import panel_tables
from steptwin.bench.six_axis_arms import arms_table, programs_tables
from steptwin.bench.step_methods.motions import all_motions
from steptwin.bench.step_methods.table import measured, print_figures
from steptwin.controller.motion.backend import KERNELS, Kernel


def _beside_others() -> Iterator[Table]:
    """Compare fastest motions with toppra, which only a checkout has, and with a look-ahead."""
    from steptwin.bench.fastest_beside_others import growth_table, look_ahead_table, toppra_table

    yield toppra_table()
    yield look_ahead_table()
    yield growth_table()


_WORDS: Final[dict[str, Callable[..., Iterable[Table | str]]]] = {
    "timing": lambda: _step_methods(_kernels()[-1]),
    "kinematics": lambda: [kinematics_table(), arms_table()],
    "programs": lambda: programs_tables(_kernels()),
    "fastest": lambda: [motions_table(), gcode_table(), corners_text()],
    "beside-others": _beside_others,
    "motor-limited": lambda: [motor_limited_table(), random_text()],
    "package": package_tables,
    "panel": panel_tables,
    "firmware": firmware_tables,
    "images": image_tables,
    "motors": lambda: [rotor_table()],
    "live-motors": lambda *pairs: [live_motors_table(*map(int, pairs))],
    "workers": lambda: [workers_table()],
    "live": lambda: live_tables(stream_s=60.0, flood_frames=1_000_000),
}


def main() -> None:
    """Print each table as soon as it is measured."""
    console = Console(highlight=False, width=110)
    chosen, *options = sys.argv[1:] or [""]
    if chosen in ("-h", "--help"):
        print(__doc__)
        return
    if chosen and (chosen not in _WORDS or (options and chosen != "live-motors")):
        sys.exit(f"{' '.join(sys.argv[1:])}: its words are {', '.join(_WORDS)}, or none for all; --help tells more")
    for table in _WORDS[chosen](*options) if chosen else _all():
        console.print(table)


def _kernels() -> list[Kernel]:
    """Return the kernel in every form that is installed, the fastest one last."""
    return [KERNELS["python"]()] + ([KERNELS["numba"]()] if find_spec("numba") else [])


def _step_methods(kernel: Kernel) -> Iterator[str]:
    """Compare the kernel's pulse timing with other ways of making step pulses."""
    yield "Pulse timing: the kernel beside other methods, against the exact crossings of the planned motion"
    print_figures(*measured(all_motions(), kernel))


def _all() -> Iterator[Table | str]:
    """Measure everything."""
    kernels = _kernels()
    fastest = kernels[-1]
    processor = platform.processor() or platform.machine()
    yield f"{processor}, {os.cpu_count()} cores, Python {platform.python_version()}"
    yield kernel_table(kernels)
    yield drawer_pull_table(kernels)
    yield compiled_text()
    yield from _step_methods(fastest)
    yield from scaling_tables(fastest)
    yield timing_table(fastest)
    yield cyclic_table(fastest)
    yield driver_table()
    yield waveform_table()
    yield kinematics_table()
    yield arms_table()
    yield from programs_tables(kernels)
    yield motions_table()
    yield rotor_table()
    yield from firmware_tables()
    if find_spec("unicorn"):
        yield from image_tables()
    if find_spec("distributed"):
        yield workers_table()
    yield from package_tables()
    yield from panel_tables()
    yield from live_tables(stream_s=10.0, flood_frames=100_000)


if __name__ == "__main__":
    main()
