"""The names that `import steptwin` gives: imported lazily, known to type checkers, described in docs/api.md."""

import ast
import re
import subprocess
import sys
import tomllib
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import steptwin
from docs.generate.api_page import API_PAGE
from steptwin.protocol.objects import ENTRIES
from steptwin.protocol.od import REVISION_NUMBER, SOFTWARE_VERSION
from tests.package.wheels import ROOT

pytestmark = pytest.mark.slow

PAGE = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
HEAVY = ["can", "canopen", "matplotlib", "numba", "numpy", "pydantic", "rich", "scipy", "typer"]


def test_import_loads_nothing_else() -> None:
    """Everything heavy is imported at the first use of a name, so `import steptwin` takes milliseconds."""
    code = f"import sys, steptwin; print([n for n in sys.modules if n in {HEAVY} or n.startswith('steptwin.')])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


def test_type_checkers_see_the_same_names() -> None:
    tree = ast.parse(Path(steptwin.__file__).with_suffix(".pyi").read_text(encoding="utf-8"))
    imports = [(node.module or "", node.names) for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    seen = {alias.name: module for module, names in imports if module.startswith("steptwin.") for alias in names}
    assert sorted(seen) == sorted(steptwin.__all__) == sorted(set(dir(steptwin)) - {"__version__"})
    for name, module in seen.items():
        assert getattr(steptwin, name) is getattr(sys.modules[module], name)


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="module 'steptwin' has no attribute 'load_robto'"):
        getattr(steptwin, "load_" + "robto")


def test_the_version_is_that_of_the_package() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["dynamic"] == ["version"]
    assert steptwin.__version__ == version("steptwin")
    assert f"\nversion: {steptwin.__version__}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")


def test_the_firmware_s_version_begins_with_its_revision() -> None:
    """0x100A is a text such as 1.2.3, and 0x1018:03 has 1 and 2 in its halves (CiA 301, 7.5.2.19)."""
    major, minor, _ = map(int, str(ENTRIES[SOFTWARE_VERSION].default).split("."))
    assert ENTRIES[REVISION_NUMBER].default == major << 16 | minor


# --- docs/api.md


def test_the_page_is_up_to_date() -> None:
    assert API_PAGE.render() == PAGE


def test_the_page_has_every_name_once() -> None:
    sections = re.findall(r"^### `(\w+).*`$", PAGE, flags=re.MULTILINE)
    rows = re.findall(r"^\| `([A-Z]\w+)[^|]*` \| ", PAGE.replace("\\|", ""), flags=re.MULTILINE)
    assert sorted(name for name in (*sections, *rows) if name in steptwin.__all__) == sorted(steptwin.__all__)


def test_every_member_has_a_docstring() -> None:
    assert len(re.findall(r"^\| `\.\w+.*` \| \S", PAGE, flags=re.MULTILINE)) > 150
    assert re.findall(r"^\| `.*` \|\s*\|$", PAGE, flags=re.MULTILINE) == []


@pytest.mark.parametrize(
    "path",
    ["README.md", "docs/first-run.md", "docs/api.md", "docs/ci.md", "docs/examples/ci/tests/test_pick_and_place.py"],
)
def test_examples_use_public_names_only(path: str) -> None:
    assert not re.findall(r"(?:from|import) steptwin\.\w+", (ROOT / path).read_text(encoding="utf-8"))


def test_the_page_s_python_runs(tmp_path: Path) -> None:
    for code in re.findall(r"^```python\n(.*?)^```", PAGE, flags=re.MULTILINE | re.DOTALL):
        subprocess.run([sys.executable, "-W", "error", "-c", code], check=True, cwd=tmp_path)


def test_a_path_is_as_good_as_its_text(tmp_path: Path) -> None:
    """For each public function that reads a file."""
    robot = steptwin.load_robot("calibration-scara")
    readers: dict[str, tuple[str, Callable[[Any], Any]]] = {
        "arm.toml": (robot.toml, steptwin.load_robot),
        "points.csv": (
            f"t,{','.join(robot.joint_names)}\n0,0,0,0,0\n1,5,5,5,5\n",
            lambda path: steptwin.read_trajectory(path, robot).velocities(np.array([0.3])).tolist(),
        ),
        "program.toml": ("[[step]]\npause = 0.5\n", steptwin.read_program),
        "faults.toml": (
            '[[fault]]\nat_s = 0.5\ndo = "estop"\npressed = true\n',
            lambda path: steptwin.read_scenario(path, robot),
        ),
        "measured.csv": (
            f"{','.join(robot.joint_names)},x,y,z\n0,0,0,0,1,2,3\n",
            lambda path: steptwin.read_measurements(path, robot).positions_mm.tolist(),
        ),
    }
    for name, (text, read) in readers.items():
        file = tmp_path / name
        file.write_text(text, encoding="utf-8")
        assert read(file) == read(str(file)), name
