"""Delete a feature, with its registration and its tests, in a copy of the checkout, and run the tests that are left.

`python -m tests.without NAME [PYTEST'S ARGUMENTS]`; features that need it go with it. Pages tell of all features, so
their tests are left out, and with a feature the tests that name it, its jobs or its robots (`tests.naming`), and those
in `USES`, which use it without naming it. Robots in `STAND_INS` are replaced by robots of the core's kinds.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from importlib.metadata import distribution
from pathlib import Path
from typing import Final

from steptwin.host.common.features import GROUP, features
from steptwin.host.robots.kinematics.kinds import CORE_KINDS
from tests.naming import tests_naming

ROOT: Final = Path(__file__).resolve().parents[1]
PAGES: Final = (
    "tests/docs",
    "tests/end_to_end/test_commands.py",
    "tests/end_to_end/test_docs.py",
    "tests/end_to_end/test_help.py",
    "tests/end_to_end/test_hostile_files.py::TestEscapes::test_of_words_of_the_command_line",
    "tests/end_to_end/test_written_commands.py",
    "tests/features/papers/test_pages.py",
)
"""Tests of pages, of all commands and of all jobs."""
USES: Final = {
    "conform": ("tests/features/personalities/test_described.py",),
    "faults": (
        "tests/end_to_end/test_foreign_folders.py::test_a_pipe_or_a_device_is_not_read",
        "tests/end_to_end/test_readme.py",
        "tests/features/firmware",
        "tests/features/panel/service",
        "tests/host/cli/test_machine_options.py",
        "tests/host/operate/test_identity.py::test_every_live_command_can_be_forced",
        "tests/live/test_shadow.py",
        "tests/live/test_live_session_in_a_browser.py",
        "tests/package/test_public_names.py",
        "tests/test_rules.py::test_every_mutation_has_its_place",
    ),
    "gcode": (
        "tests/features/panel/page/test_motions.py::test_a_wrong_file_is_named_as_its_user_knows_it",
        "tests/features/panel/page/test_uploads.py",
        "tests/host/planning/programs/test_reading.py::test_everything_that_is_wrong_is_found_at_once",
        "tests/host/planning/programs/test_schema.py::test_it_accepts_the_programs_of_the_page",
        "tests/host/planning/programs/test_schema.py::test_it_accepts_the_programs_that_come_along[compass]",
    ),
    "motors": (
        "tests/end_to_end/test_replacing.py::test_of_a_folder[<lambda>-option5-names5]",
        "tests/features/makers/test_new_from.py::test_a_motor_brings_all_that_motors_need",
        "tests/host/cli/test_machine_options.py::test_a_key_that_is_wrong",
        "tests/package/test_public_names.py",
    ),
    "nodes": ("tests/features/personalities/test_described.py",),
    "papers": (
        "tests/end_to_end/test_calibration_page.py::test_the_program_runs",
        "tests/end_to_end/test_files.py::TestARobotOfOnesOwn::test_has_other_dimensions_in_fk_ik_and_jobs",
        "tests/end_to_end/test_hardware_page.py",
        "tests/end_to_end/test_narrow_terminal.py::test_the_report_of_a_run_fits[teaching-scara]",
        "tests/end_to_end/test_programs.py::test_no_example_is_left_out",
        "tests/features/calibration/test_calibration_commands.py",
        "tests/features/calibration/test_files.py::TestErrorsInARobotFile::test_what_is_wrong",
        "tests/features/campaigns/test_docs.py::test_the_nightly_campaign_has_every_fault",
        "tests/features/faults/test_users.py::test_the_python_of_the_page",
        "tests/features/urdf/test_urdf_command.py::test_a_robot_becomes_a_urdf",
        "tests/features/urdf/test_urdf_export.py::test_other_kinds_are_refused_by_name",
        "tests/host/cli/test_check_robot.py::test_a_renamed_joint_is_said_to_be_missing",
        "tests/host/cli/test_new.py::test_wrong_settings_write_nothing[words0]",
        "tests/host/cli/test_new.py::test_wrong_settings_write_nothing[words1]",
    ),
    "shelf": (
        "tests/end_to_end/test_bad_input.py::test_one_line_and_exit_code_2[job]",
        "tests/end_to_end/test_bad_input.py::test_one_line_and_exit_code_2[kind of file]",
        "tests/end_to_end/test_files.py::TestARobotOfOnesOwn::test_may_use_brackets_in_its_names",
        "tests/features/arms/test_tool_step.py",
        "tests/features/fastest/test_again.py",
        "tests/features/view/test_extent.py",
        "tests/features/papers/test_pull_line.py::TestOptions",
        "tests/host/record/folder/test_digests.py",
        "tests/host/record/folder/test_folder.py",
        "tests/host/record/folder/test_verify_folder.py",
        "tests/host/robots/kinematics/test_on_base.py::TestRobotFile::test_a_shelf_is_not_turned",
        "tests/host/robots/test_robot_files.py::TestMistakesInAFile::test_an_error_names_its_key[top]",
    ),
}
"""Tests outside a feature's folder that use the feature: its jobs, its tables of a robot file, its options."""
STAND_INS: Final = {
    "lab-scara": """\
l1_mm = 400.0
l2_mm = 400.0
lift = "first"
lift_positive = "up"
heading_deg = 90.0
drop_mm = 150.0
""",
    "teaching-scara": """\
l1_mm = 95.0
l2_mm = 100.0
lift_positive = "down"
tool = "up"
drop_mm = 40.0
""",
    "calibration-scara": """\
l1_mm = 250.0
l2_mm = 350.0
lift_positive = "down"
base_mm = 300.0
""",
}
"""Robots of features that many tests use for their joints and poses: the keys of the same arm's kind `scara`."""
STAND_IN_FEATURE: Final = """\
from pathlib import Path

from steptwin.host.common.features import Feature

FEATURE = Feature(name="stand_ins", robots=Path(__file__).parent)
"""


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


def _stand_in(gone: Sequence[str], copy: Path) -> None:
    """Add a feature with the robots that stand in for those of the features that are gone, if there are any."""
    texts = {
        path.name: re.sub(
            r'^kind = "[^"]*"\n(\w+_(mm|deg) = .*\n)*', f'kind = "scara"\n{STAND_INS[path.stem]}', text, flags=re.M
        )
        for path in _robots(gone)
        if path.stem in STAND_INS
        for text in [path.read_text(encoding="utf-8")]
    }
    if texts:
        folder = copy / "features" / "stand_ins"
        folder.mkdir()
        for name, text in {**texts, "__init__.py": STAND_IN_FEATURE}.items():
            (folder / name).write_text(text, encoding="utf-8")
        points = copy.parent / "meta" / "steptwin.dist-info" / "entry_points.txt"
        points.write_text(
            points.read_text(encoding="utf-8").replace(
                f"[{GROUP}]\n", f"[{GROUP}]\nstand_ins = steptwin.features.stand_ins:FEATURE\n"
            ),
            encoding="utf-8",
        )


def _robots(gone: Sequence[str]) -> list[Path]:
    folders = [folder for name in gone if (folder := features()[name].robots) is not None]
    return [path for folder in folders for path in sorted(folder.glob("*.toml"))]


def words_of(gone: Sequence[str]) -> re.Pattern[str]:
    """Return the pattern of what tests may not name without the features: modules, robots and their kinds, jobs."""
    robots = [path.stem for path in _robots(gone)]
    own = [features()[name] for name in gone]
    kinds = {kind for each in own if each.kinematics is not None for kind in each.kinematics()} - CORE_KINDS.keys()
    jobs = {job.name for each in own if each.jobs is not None for row in each.jobs().values() for job in row}
    words = [
        rf"\b(?:steptwin|tests)\.features\.(?:{'|'.join(gone)})\.",
        *(rf"\b{robot}\b" for robot in robots if robot not in STAND_INS),
        *(rf"""kind\W+{kind}\b""" for kind in sorted(kinds)),
        *(rf"(?:^|[\s`\"]){job}(?:$|[\s`\"])" for job in sorted(jobs)),
    ]
    return re.compile("|".join(words))


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
        gone = gone_with(sys.argv[1])
        _stand_in(gone, without)
        users = [test for each in gone for test in USES.get(each, ())]
        left_out = []
        for test in (*PAGES, *users, *tests_naming(words_of(gone), without)):
            if "::" in test:
                left_out.append(f"--deselect={test}")
            elif (without / test).is_dir():
                shutil.rmtree(without / test)
            else:
                (without / test).unlink(missing_ok=True)
        done = run_in(without, "-m", "pytest", "-q", "-p", "no:cacheprovider", *left_out, *sys.argv[2:])
        sys.stdout.write(done.stdout + done.stderr)
        sys.exit(done.returncode)
