"""The SHA-256 of everything that each job leaves: `python -m tests.end_to_end.fingerprints` compares it with the file.

A change that is not meant to alter motion leaves every edge and every frame as they are, byte for byte. Edges and bus
logs are integers; report and trajectory hold floats, whose last digits may differ from processor to processor, so the
tests hold the integers and this command holds all that is stored. `--write` makes the present state the one to compare
with. Of runs with waits for sensors, motors in the loop, faults and two boards the file has the integers alone. With
`--replay` the bus logs of the others are replayed, too, which must make the same edges and frames.
"""

import hashlib
import json
import sys
from collections.abc import Iterator
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from steptwin.host.cli.app import run
from tests.run_pictures import without_pictures

FILE = Path(__file__).with_suffix(".json")
INTEGERS = ("bus.log", "edges.npz")
"""The files whose bytes follow from integers alone."""
FILES = (*INTEGERS, "trace.vcd", "trajectory.csv", "report.json")


def stored() -> dict[str, dict[str, str]]:
    """The hashes to compare with, by command and file."""
    loaded: dict[str, dict[str, str]] = json.loads(FILE.read_text(encoding="ascii"))
    return loaded


def fingerprint(folder: Path, name: str) -> str:
    """The SHA-256 of a file of a run folder, without what differs from run to run."""
    digest = hashlib.sha256()
    for part in _parts(folder / name):
        digest.update(part)
    return digest.hexdigest()


def _parts(path: Path) -> Iterator[bytes]:
    if path.suffix == ".npz":  # the archive carries the time of its making
        with np.load(path) as arrays:
            for key in sorted(arrays.files):
                array = arrays[key]
                yield f"{key}{array.dtype}{array.shape}".encode()
                yield np.ascontiguousarray(array).tobytes()
    elif path.suffix == ".json":
        document = json.loads(path.read_bytes())
        del document["wall_s"]
        yield json.dumps(document, sort_keys=True).encode()
    else:
        yield path.read_bytes()


REPLAY = "replay"
"""Folder in a run's folder, of the replay of its bus log."""


def _measured(command: str, *, replay: bool) -> dict[str, str]:
    with TemporaryDirectory() as folder, redirect_stdout(StringIO()), redirect_stderr(StringIO()):
        run(["run", *command.split(), "--out", folder])
        hashes = {name: fingerprint(Path(folder), name) for name in FILES}
        if replay:
            again = Path(folder) / REPLAY
            run(["replay", folder, "--out", str(again)])
            hashes |= {f"{REPLAY}/{name}": fingerprint(again, name) for name in INTEGERS}
        return hashes


def main() -> int:
    """Run every job, without pictures; print what differs."""
    replay = "--replay" in sys.argv
    with without_pictures():
        now = {
            command: _measured(command, replay=replay and FILES[-1] in hashes) for command, hashes in stored().items()
        }
    if "--write" in sys.argv:
        kept = {command: {name: hashes[name] for name in stored()[command]} for command, hashes in now.items()}
        FILE.write_text(json.dumps(kept, indent=1) + "\n", encoding="ascii")
    lines = [
        f"{command}: {name} differs"
        for command, hashes in stored().items()
        for name, digest in now[command].items()
        if hashes.get(name.removeprefix(f"{REPLAY}/"), digest) != digest
    ]
    files = f"{len(INTEGERS)} to {len(FILES)} files each" + (f", {len(INTEGERS)} of its replay" if replay else "")
    sys.stdout.write("\n".join(lines or [f"{len(now)} runs, {files}: the same"]) + "\n")
    return 1 if lines else 0


if __name__ == "__main__":
    sys.exit(main())
