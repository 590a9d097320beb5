"""Render docs/machine-options.md: the options of the emulated machine, on the command line and in Python."""

import re
from dataclasses import fields
from typing import Final

from docs.generate.commands import DOCS
from steptwin.host.studies.papers.paper_page import table
from steptwin.host.twin.machine.machine_options import SPELLING, MachineOptions

MACHINE_PAGE: Final = DOCS / "machine-options.md"

_NOTICE: Final = "<!-- Made by `make docs` from host/twin/machine/machine_options.py: change that. -->"
_TEXT: Final = """# The emulated machine's options

They say how an emulated machine differs from its robot's file, and what happens to it. Neither the plan nor the host is
told. `steptwin run` and `steptwin serve` have them as options, and so has `steptwin replay`, but for a scenario and for
motors. `execute`, `ServedBoard`, `BoardUnderTest` and `ServedBoardUnderTest` have them as keyword arguments
([api.md](api.md)), the marker `steptwin` of tests as well ([ci.md](ci.md))."""
_REMARKS: Final = """\
`run` has no `--bitrate`: its option of that name is for a live board. Its `--motors` lets the motors turn after
the run, by its record, and `--motors=loop` as it goes. In Python `stand_at` may also list all joints,
`crystal_ppm` may be one number for all boards, and `scenario` a `Scenario` or a list of harms from power-up on;
a scenario of a served board may not harm the host, and motors that turn in real time need numba. The shelf holds the
boxes of an errand unless `stock` says otherwise."""


def render_machine_options() -> str:
    """Return the whole page; it ends with a newline."""
    rows = []
    for field in fields(MachineOptions):
        spelling = field.metadata[SPELLING]
        says = re.sub(r"\bdocs/([\w-]+\.md)", r"[\1](\1)", spelling.says)
        rows.append(
            [f"`{spelling.option} {spelling.value}`".replace(" `", "`"), f"`{field.name}={spelling.example}`", says]
        )
    options = table(["option", "in Python", ""], rows, text_columns=3)
    return f"{_NOTICE}\n\n{_TEXT}\n\n{options}\n\n{_REMARKS}\n"
