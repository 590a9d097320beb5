"""Commands of `steptwin` with what they print."""

import re
import shlex
from contextlib import redirect_stdout
from io import StringIO
from typing import Final

from docs.generate.markdown import code
from steptwin.host.cli.app import run

_STYLE: Final = re.compile(r"\x1b\[[0-9;]*m")
"""Bold type, where the environment forces it upon what is no terminal."""


def session(arguments: str, expected_exit_code: int = 0) -> str:
    """The command line and its output, but for what the clock on the wall says, as one block.

    Raises:
        ValueError: it does not end as expected.
    """
    printed = StringIO()
    with redirect_stdout(printed):
        exit_code = run(shlex.split(arguments))
    if exit_code != expected_exit_code:
        raise ValueError(f"steptwin {arguments}: exit code {exit_code}")
    lines = (line.rstrip() for line in _STYLE.sub("", printed.getvalue()).splitlines())
    return code("\n".join([f"$ steptwin {arguments}", *(line for line in lines if "x real time" not in line)]))
