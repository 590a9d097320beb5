"""`steptwin bench [ROBOT [JOB]]`: compare the kernel's pulse timing with other ways of making step pulses."""

from importlib.util import find_spec
from typing import TYPE_CHECKING

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import RobotOptions
from steptwin.host.cli.options import argument
from steptwin.host.cli.output import print_table, say
from steptwin.host.common.errors import InputError
from steptwin.host.common.extras import installing

if TYPE_CHECKING:
    from steptwin.host.studies.step_methods.cortex_m3 import CoreFigures
    from steptwin.host.studies.step_methods.evaluation import MethodErrors

ROBOT_AND_JOB = "[ROBOT] [JOB]"


@command("", "teaching-scara carry --json")
def bench(
    which: RobotOptions,
    words: list[str] | None = argument(ROBOT_AND_JOB, "A job, or all jobs of a robot; by default five motions."),
) -> None:
    """Compare the kernel's step timing with a DDA, Bresenham and Austin's ramp on the same motions."""
    from steptwin.host.planning.jobs import job_names
    from steptwin.host.studies.step_methods.motions import all_motions, motion_of_job
    from steptwin.host.studies.step_methods.table import document, measured
    from steptwin.host.twin.machine.kernels import fastest_kernel

    if not find_spec("numba"):
        say(f"numba is not installed ({installing('fast')}): this takes minutes", err=True)
    if words or which.robot_file is not None:
        robot, rest = which.robot_and_rest(words)
        if len(rest) > 1:
            raise InputError(f"unexpected argument '{rest[1]}': give {ROBOT_AND_JOB}")
        motions = [motion_of_job(robot, job) for job in rest or job_names(robot)]
    else:
        motions = all_motions()
    kernel = fastest_kernel()
    figures, on_core = measured(motions, kernel)
    which.tell(document(figures, on_core, kernel), lambda: print_figures(figures, on_core))


def print_figures(figures: "list[MethodErrors]", on_core: "list[CoreFigures]") -> None:
    """Print the table of the methods, and that of the kernel on an emulated core where that was metered."""
    from steptwin.host.studies.step_methods.cortex_m3 import COLUMNS as CORE_COLUMNS
    from steptwin.host.studies.step_methods.cortex_m3 import core_rows
    from steptwin.host.studies.step_methods.table import COLUMNS, table_rows

    print_table(list(COLUMNS), table_rows(figures), text_columns=2)
    if on_core:
        flash = f"{on_core[0].text_bytes} bytes of flash"
        say(f"The kernel on an emulated Cortex-M3, in each motion's busiest 100 ms; {flash}:")
        print_table(list(CORE_COLUMNS), core_rows(on_core), text_columns=1)
    else:
        say(f"no Cortex-M3: it needs numba, unicorn ({installing('fast', 'm3')}) and arm-none-eabi-gcc", err=True)
