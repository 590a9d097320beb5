"""A process that runs commands within bounds, and tells what each said and the most memory that it took.

`python -m tests.end_to_end.bounded_child FILE`: the file has a JSON list of commands, each a list of words. It prints a
JSON list: exit code, stderr, and the process' highest resident memory so far, in MiB, of each command.
"""

import json
import resource
import sys
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

from steptwin.host.cli.app import run

ADDRESSES_BYTES = 2 << 30
CPU_S = 60


def made(words: list[str]) -> list[Any]:
    with redirect_stdout(StringIO()), redirect_stderr(StringIO()) as err:
        code = run(words)
    return [code, err.getvalue(), _peak_mib()]


def _peak_mib() -> int:
    """Return the most memory of this process; what `getrusage` says begins with the memory of the process before it."""
    (line,) = [line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmHWM:")]
    return int(line.split()[1]) >> 10


if __name__ == "__main__":
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESSES_BYTES, ADDRESSES_BYTES))
    resource.setrlimit(resource.RLIMIT_CPU, (CPU_S, CPU_S))
    commands = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    sys.stdout.write(json.dumps([made(words) for words in commands]))
