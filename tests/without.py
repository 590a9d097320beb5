"""Delete a feature, with its registration and its tests, in a copy of the checkout, and run the tests that are left.

`python -m tests.without NAME [PYTEST'S ARGUMENTS]`; features that need it go with it. Pages tell of all features, so
their tests are left out, and with a feature the tests in `USES` that use it beside its own.
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
PAGES: Final = (
    "tests/docs",
    "tests/end_to_end/test_commands.py",
    "tests/end_to_end/test_docs.py",
    "tests/end_to_end/test_help.py",
    "tests/end_to_end/test_hostile_files.py::TestEscapes::test_of_words_of_the_command_line",
    "tests/end_to_end/test_written_commands.py",
    "tests/features/papers",
)
"""Tests of pages, of all commands and of all jobs."""
USES: Final = {
    "campaigns": (
        "tests/live/test_campaign_cluster.py",
        "tests/package/test_wheel.py",
        "tests/test_promises.py",
    ),
    "faults": (
        "tests/end_to_end/test_foreign_folders.py::test_a_pipe_or_a_device_is_not_read",
        "tests/end_to_end/test_readme.py",
        "tests/features/firmware",
        "tests/features/motors/turning/test_in_loop.py",
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
    "shelf": (
        "tests/end_to_end/test_bad_input.py::test_one_line_and_exit_code_2[job]",
        "tests/end_to_end/test_bad_input.py::test_one_line_and_exit_code_2[kind of file]",
        "tests/end_to_end/test_files.py::TestARobotOfOnesOwn::test_may_use_brackets_in_its_names",
        "tests/end_to_end/test_files.py::TestARobotOfOnesOwn::test_that_cannot_do_the_job_says_why[no place]",
        "tests/end_to_end/test_stored_runs.py::TestPlot::test_without_matplotlib",
        "tests/features/arms/test_tool_step.py",
        "tests/features/fastest/test_again.py",
        "tests/features/view/test_extent.py",
        "tests/host/planning/jobs/test_options.py",
        "tests/host/planning/jobs/test_other_sizes.py",
        "tests/host/planning/jobs/test_pull_line.py::TestOptions",
        "tests/host/record/folder/test_digests.py",
        "tests/host/record/folder/test_folder.py",
        "tests/host/record/folder/test_verify_folder.py",
        "tests/host/record/test_recorded_machine.py",
        "tests/host/robots/kinematics/test_on_base.py::TestRobotFile::test_a_shelf_is_not_turned",
        "tests/host/robots/test_robot_files.py::TestMistakesInAFile::test_an_error_names_its_key[top]",
    ),
}
"""Tests outside a feature's folder that use the feature: its jobs, its tables of a robot file, its options."""


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
        users = [test for each in gone_with(sys.argv[1]) for test in USES.get(each, ())]
        left_out = [f"--deselect={test}" if "::" in test else f"--ignore={test}" for test in (*PAGES, *users)]
        done = run_in(without, "-m", "pytest", "-q", "-p", "no:cacheprovider", *left_out, *sys.argv[2:])
        sys.stdout.write(done.stdout + done.stderr)
        sys.exit(done.returncode)
