"""Delete a feature, with its registration and its tests, in a copy of the checkout, and run the tests that are left.

`python -m tests.without NAME [PYTEST'S ARGUMENTS]`; features that need it go with it.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
from importlib.metadata import distribution
from pathlib import Path
from typing import Final

from steptwin.host.common.features import GROUP, features

ROOT: Final = Path(__file__).resolve().parents[1]


def gone_with(name: str) -> list[str]:
    """Return a feature and those that need it, or need one of these."""
    gone = [name]
    for each in gone:
        gone += [other.name for other in features().values() if each in other.needs and other.name not in gone]
    return gone


def copy_without(name: str, folder: Path) -> Path:
    """Copy the checkout without a feature into a folder, with what Python must know of the package; return the copy."""
    gone, copy = gone_with(name), folder / "checkout"
    left_out = tuple(f"{part}/{each}/" for part in ("features", "tests/features") for each in gone)
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    for path in listed.splitlines():
        if not path.startswith(left_out):
            (copy / path).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / path, copy / path, follow_symlinks=False)
    registered = re.compile(rf"^(?:{'|'.join(gone)}) = .*\n", re.MULTILINE)
    for file, text in (
        (copy / "pyproject.toml", (ROOT / "pyproject.toml").read_text(encoding="utf-8")),
        (folder / "meta" / "steptwin.dist-info" / "entry_points.txt", _entry_points()),
    ):
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(registered.sub("", text), encoding="utf-8")
    described = distribution("steptwin").read_text("METADATA")
    (folder / "meta" / "steptwin.dist-info" / "METADATA").write_text(described or "", encoding="utf-8")
    return copy


def _entry_points() -> str:
    text = distribution("steptwin").read_text("entry_points.txt")
    assert text is not None
    assert f"[{GROUP}]" in text
    return text


def run_in(copy: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Run Python in a copy, which it imports instead of what is installed."""
    path = os.pathsep.join(map(str, (copy.parent / "meta", copy)))
    return subprocess.run(
        [sys.executable, *words],
        cwd=copy,
        env=os.environ | {"PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as made:
        without = copy_without(sys.argv[1], Path(made))
        done = run_in(without, "-m", "pytest", "-q", "-p", "no:cacheprovider", *sys.argv[2:])
        sys.stdout.write(done.stdout + done.stderr)
        sys.exit(done.returncode)
