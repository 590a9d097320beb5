"""The pages that `make docs` writes are up to date; pictures and links exist; the Python blocks run."""

import dataclasses
import re
import shlex
from pathlib import Path
from typing import Any

import pytest

from docs.generate.command_line import COMMAND_LINE_PAGE, render_command_line
from docs.generate.commands import DOCS
from docs.generate.driver_page import DRIVER_PAGE
from docs.generate.machine_pages import FAULTS_PAGE, RUN_FOLDER_PAGE
from docs.generate.masters_page import MASTERS_PAGE
from docs.generate.paper_pages import PAPERS, PAPERS_FOLDER, render_paper
from docs.generate.paper_results import SAMPLED
from docs.generate.programs_page import PROGRAMS_PAGE
from docs.generate.protocol import PROTOCOL_PAGE
from docs.generate.robot_drawings import ROBOT_FILES_PAGE, drawing
from docs.generate.runs import Runs
from docs.generate.tables import WrittenValue, read_robot_file
from steptwin.host.cli.app import run
from steptwin.host.robots import MACHINES, robot_names
from steptwin.host.robots.board_settings import BoardSettings
from steptwin.host.robots.joint import Joint, Transmission
from steptwin.host.robots.kinematics.kinds import kinds
from steptwin.host.robots.robot import Robot
from steptwin.host.robots.switches import JointHoming, JointSwitches
from tests.end_to_end.marks import slow_but
from tests.end_to_end.pages import ROOT, run_python

MACHINES_PAGE = (DOCS / "machines.md").read_text(encoding="utf-8")
ROBOT_FILES = (DOCS / "robot-files.md").read_text(encoding="utf-8")
ALL_TEXT = "".join(path.read_text(encoding="utf-8") for path in sorted(DOCS.glob("*.md")))
PICTURE_BYTES_MAX = 120_000
CHEAP = {"teaching-scara"}
"""Robots whose jobs take little time."""


@pytest.mark.slow
@pytest.mark.parametrize("robot", PAPERS)
def test_the_page_of_a_paper_is_up_to_date(robot: str, runs: Runs) -> None:
    """If this fails, run `make docs` and review what changed."""
    assert render_paper(robot, runs) == (PAPERS_FOLDER / f"{robot}.md").read_text(encoding="utf-8")


def test_the_protocol_page_is_up_to_date() -> None:
    assert PROTOCOL_PAGE.render() == PROTOCOL_PAGE.path.read_text(encoding="utf-8")


@pytest.mark.slow
def test_the_page_of_faults_is_up_to_date(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    assert FAULTS_PAGE.render() == FAULTS_PAGE.path.read_text(encoding="utf-8")


def test_the_page_of_masters_is_up_to_date() -> None:
    assert MASTERS_PAGE.render() == MASTERS_PAGE.path.read_text(encoding="utf-8")


def test_the_page_of_programs_is_up_to_date() -> None:
    assert PROGRAMS_PAGE.render() == PROGRAMS_PAGE.path.read_text(encoding="utf-8")


def test_the_page_of_the_run_folder_is_up_to_date() -> None:
    assert RUN_FOLDER_PAGE.render() == RUN_FOLDER_PAGE.path.read_text(encoding="utf-8")


def test_the_page_of_the_command_line_is_up_to_date() -> None:
    assert render_command_line() == COMMAND_LINE_PAGE.read_text(encoding="utf-8")


@pytest.mark.slow
def test_the_driver_page_is_up_to_date() -> None:
    assert DRIVER_PAGE.render() == DRIVER_PAGE.path.read_text(encoding="utf-8")


def test_the_page_of_robot_files_is_up_to_date() -> None:
    assert ROBOT_FILES_PAGE.render() == ROBOT_FILES_PAGE.path.read_text(encoding="utf-8")


@pytest.mark.parametrize("keys", [BoardSettings, Joint, Transmission, JointSwitches, JointHoming, Robot])
def test_the_page_of_robot_files_has_every_key(keys: type[Any]) -> None:
    """Fields that are no keys: a joint's transmission, a robot's dimensions, features' tables, and its text."""
    no_keys = {"transmission", "geometry", "sections", "toml"}
    page = ROBOT_FILES_PAGE.path.read_text(encoding="utf-8")
    for field in dataclasses.fields(keys):
        spelled = (f"`{field.name}`", f"`[{field.name}", f".{field.name}]`")
        assert field.name in no_keys or any(words in page for words in spelled), field.name


@pytest.mark.parametrize("kind", kinds())
def test_every_kind_has_a_drawing(kind: str) -> None:
    assert 1000 < drawing(kind).stat().st_size < PICTURE_BYTES_MAX


def test_every_robot_is_described() -> None:
    """Those of papers in docs/papers, machines that people build in docs/machines.md."""
    assert {*PAPERS, *MACHINES} == set(robot_names())
    assert [name for name in MACHINES if f"`{name}`" not in MACHINES_PAGE] == []


def test_the_robots_of_papers_have_one_board() -> None:
    """As docs/machines.md says."""
    boards = [read_robot_file(name)["board"] for name in PAPERS]
    assert all(board == boards[0] for board in boards)


def test_links_lead_somewhere() -> None:
    targets = re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", ALL_TEXT)
    assert len(targets) > 30
    for target in targets:
        assert target.startswith("https://") or (DOCS / target).exists(), target


def test_pictures_are_small() -> None:
    papers = "".join(path.read_text(encoding="utf-8") for path in sorted(PAPERS_FOLDER.glob("*.md")))
    pictures = set(re.findall(r"\((?:\.\./)?(pictures/[^)]+)\)", ALL_TEXT + papers))
    files = (path for path in (DOCS / "pictures").rglob("*") if path.is_file())
    assert {path.relative_to(DOCS).as_posix() for path in files} == pictures
    for name in pictures:
        bytes_max = 500_000 if name.endswith(".gif") else PICTURE_BYTES_MAX
        assert (DOCS / name).stat().st_size < bytes_max, name


def test_python(tmp_path: Path) -> None:
    page = (PAPERS_FOLDER / "teaching-scara.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"^```python\n(.*?)^```", page, flags=re.MULTILINE | re.DOTALL)
    run_python(code, tmp_path)


@pytest.mark.slow
def test_the_commands_for_waveforms(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All commands in their order."""
    pytest.importorskip("matplotlib", reason="the extra `plot` (matplotlib) is not installed")
    monkeypatch.chdir(tmp_path)
    page = RUN_FOLDER_PAGE.path.read_text(encoding="utf-8")
    block = re.findall(r"^```\n(.*?)^```", page, flags=re.MULTILINE | re.DOTALL)[0]
    commands = [shlex.split(line, comments=True) for line in block.splitlines()]
    assert len(commands) == 7
    for words in commands:
        assert run(words[1:]) == 0, words
    left = {path.relative_to("out").as_posix() for path in Path("out").rglob("*.*")}
    assert left >= {
        "helix/trace.vcd",
        "helix/trace-full.vcd",
        "helix/trace-part.csv",
        "helix/edges.png",
        "helix/phases.png",
    }
    assert "paper/tool-path.pdf" in left


@pytest.mark.parametrize(("robot", "job"), slow_but([key for key in SAMPLED if key[0] in CHEAP], SAMPLED))
def test_runs_agree_with_the_papers_samples(robot: str, job: str, runs: Runs) -> None:
    """The helix' 241 samples are too far apart to show where the sliders reverse."""
    sampled, report = SAMPLED[robot, job], runs.outcome(robot, job).report
    between_samples = 0.001 if job == "helix" else 0.0
    for axis, pulses in zip(report.axes, sampled.pulses, strict=True):
        assert abs(axis.pulses - pulses) <= 2 * axis.reversals + between_samples * pulses
    assert sampled.tool_mm <= report.tool.position_error_mm_max <= 1.5 * sampled.tool_mm


@pytest.mark.parametrize("robot", [*PAPERS, *MACHINES])
def test_every_number_of_a_robot_is_marked(robot: str) -> None:
    for name, section in read_robot_file(robot).items():
        marked = name.startswith(("places.", "boxes.", "shelf.")) and section.comment.startswith("[")
        for key, entry in section.entries.items():
            assert entry.mark or marked or key in {"name", "title", "paper", "kind", "notation", "unit"}, (name, key)


def test_a_robot_file_is_read_with_its_notes() -> None:
    sections = read_robot_file("lab-scara")
    assert sections["joints.d1"].comment == "lift: motor straight on a ball screw"
    assert sections["joints.d1"].entries["upper"] == WrittenValue("250.0", "[S]", "stroke")
    assert sections["joints.d1"].entries["unit"] == WrittenValue("mm", "", "")
    assert sections["board"].entries["osc_pf"].value == "330"


@pytest.mark.parametrize(
    "page",
    [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")), *sorted(PAPERS_FOLDER.glob("*.md"))],
    ids=lambda page: page.name,
)
def test_links_of_every_page_lead_somewhere(page: Path) -> None:
    for target in re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8")):
        assert target.startswith("https://") or (page.parent / target).exists(), target


def test_every_page_is_listed() -> None:
    """A page that docs/index.md does not name is found by nobody."""
    listed = re.findall(
        r"^- .*?\]\(([^)]+)\)", (ROOT / "docs/index.md").read_text(encoding="utf-8"), flags=re.MULTILINE
    )
    docs = ROOT / "docs"
    pages = {page.relative_to(docs).as_posix() for page in (*docs.glob("*.md"), *docs.glob("papers/*.md"))}
    assert sorted(page for page in listed if not page.startswith("..")) == sorted(pages - {"index.md"})


def test_the_change_log_is_short() -> None:
    """It says what users get, in at most 150 lines."""
    assert len((ROOT / "CHANGELOG.md").read_text(encoding="utf-8").splitlines()) <= 150
