"""Give the tests of other projects an emulated board in virtual time or real time, as a pytest plugin (docs/ci.md).

pytest imports this module at every start where StepTwin is installed. So all else is imported only for a test that
needs a board.
"""

from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack, cast

import pytest

if TYPE_CHECKING:
    from pluggy import Result

    from steptwin.controller.motion.backend import Kernel
    from steptwin.emulator.operations import Scheduled
    from steptwin.host.robots.robot import Robot
    from steptwin.host.twin.board_under_test import BoardUnderTest, ServedBoardUnderTest
    from steptwin.host.twin.machine.machine_options import MachineKeywords

    MakeBoard = Callable[..., BoardUnderTest]

_MARKER = "steptwin"
_INI = "steptwin_robot"
_ARTEFACTS_INI = "steptwin_artefacts"
_ARTEFACTS_OPTION = "--steptwin-artefacts"
_FAILED = pytest.StashKey[bool]()
"""True for a test with a failed setup or call."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the settings for the default robot, and for the place of failed tests' folders."""
    parser.addini(_INI, "StepTwin: the robot of `steptwin_board`, a name or the path of a robot file", default="")
    where = "StepTwin: folder in which the boards of failed tests are kept; by default in pytest's temporary folder"
    parser.addini(_ARTEFACTS_INI, where, default="")
    parser.getgroup("steptwin").addoption(_ARTEFACTS_OPTION, metavar="DIR", default=None, help=where)


@pytest.hookimpl(hookwrapper=True)  # the newer wrapper=True needs pytest 8
def pytest_runtest_makereport(item: pytest.Item) -> "Generator[None, Result[pytest.TestReport], None]":
    """Register a failed test, for fixtures that are torn down after it."""
    outcome = yield
    if outcome.get_result().failed:
        item.stash[_FAILED] = True


def pytest_configure(config: pytest.Config) -> None:
    """Register the marker."""
    config.addinivalue_line(
        "markers",
        f"{_MARKER}(robot, schedule, **machine): which board `steptwin_board` is (docs/ci.md)",
    )


@pytest.fixture(scope="session")
def steptwin_kernel() -> "Kernel":
    """Return the fastest form of the firmware's kernel, loaded once in a session."""
    from steptwin.controller.motion.backend import fastest_kernel

    return fastest_kernel()


@pytest.fixture
def steptwin_make_board(
    request: pytest.FixtureRequest, steptwin_kernel: "Kernel", tmp_path_factory: pytest.TempPathFactory
) -> "Iterator[MakeBoard]":
    """Return a function that switches boards on, each on a bus of its own, for tests that need several.

    Its arguments, all optional:
        robot: the robot's name, or the path of a robot file from pytest's root directory; else the ini-file's robot.
        schedule: operations on the machine beside its motion, each with its instant.
        machine: how the machine differs from the robot's file, and what happens to it: the fields of `MachineOptions`;
            relative paths begin at pytest's root directory.
    """
    from steptwin.host.common.errors import InputError
    from steptwin.host.twin.board_under_test import BoardUnderTest, machine_warnings
    from steptwin.host.twin.marker_arguments import check_board

    boards: list[BoardUnderTest] = []

    def make(
        robot: Path | str = "",
        *,
        schedule: "Iterable[Scheduled]" = (),
        **machine: "Unpack[MachineKeywords]",
    ) -> BoardUnderTest:
        schedule = list(schedule) if isinstance(schedule, Iterator) else schedule
        try:
            check_board({"robot": robot, "schedule": schedule, **machine})
            loaded = _robot(robot or request.config.getini(_INI), request.config)
            options = _from_root(machine, loaded, request.config)
            board = BoardUnderTest(loaded, kernel=steptwin_kernel, schedule=schedule, **options)
        except InputError as error:
            pytest.fail(f"steptwin: {error}", pytrace=False)
        boards.append(board)
        return board

    yield make
    for board in boards:
        _tell(request.node, board)
        if _has_failed(request.node):
            _add(request.node, machine_warnings(board))
    _keep(request.node, [board.save for board in boards], _artefacts(request.config, tmp_path_factory))


def _tell(node: pytest.Item, board: "BoardUnderTest") -> None:
    """Add a board's evidence to the test's report."""
    from steptwin.host.twin.board_under_test import last_frames, parts_in_words, strikes

    sections = {"bus": last_frames(board.robot, board.bus_log), "faults of the bus": strikes(board)}
    _add(node, sections | parts_in_words(board) | {"settings": "\n".join(map(str, board.mismatches()))})


def _keep(node: pytest.Item, saves: "Sequence[Callable[[Path], None]]", artefacts: Path) -> None:
    """Save the folder of each board of a failed test, and add their places to its report."""
    if not _has_failed(node):
        return
    from steptwin.host.twin.board_under_test import folders_of, kept

    for save, folder in zip(saves, folders_of(node.nodeid, artefacts), strict=False):
        _add(node, {"run folder": kept(save, folder)})


def _has_failed(node: pytest.Item) -> bool:
    return node.stash.get(_FAILED, False)


def _add(node: pytest.Item, sections: Mapping[str, str]) -> None:
    for title, text in sections.items():
        if text:
            node.add_report_section("teardown", f"steptwin {title} (SIMULATED)", text)


def _artefacts(config: pytest.Config, factory: pytest.TempPathFactory) -> Path:
    """Return the folder for artefacts of failed tests: by the command line, else the ini-file, else pytest's."""
    given = config.getoption(_ARTEFACTS_OPTION) or config.getini(_ARTEFACTS_INI)
    return config.rootpath / given if given else factory.getbasetemp() / "steptwin"


@pytest.fixture
def steptwin_board(request: pytest.FixtureRequest, steptwin_make_board: "MakeBoard") -> "BoardUnderTest":
    """Return an emulated board in virtual time, as the markers `steptwin` of the test, its class and its module say."""
    from steptwin.host.common.errors import InputError

    try:
        settings = _settings(request.node)
    except InputError as error:
        pytest.fail(f"steptwin: {error}", pytrace=False)
    return steptwin_make_board(**settings)


@pytest.fixture
def steptwin_served_board(
    request: pytest.FixtureRequest, steptwin_kernel: "Kernel", tmp_path_factory: pytest.TempPathFactory
) -> "Iterator[ServedBoardUnderTest]":
    """Return a board in real time at a socketcand port, for programs of any language, as the markers `steptwin` say.

    It takes no `schedule`; its method `operate` does an operation while it runs.
    """
    from steptwin.host.common.errors import StepTwinError
    from steptwin.host.twin.board_under_test import ServedBoardUnderTest, last_frames
    from steptwin.host.twin.marker_arguments import check_served_board

    node, config = request.node, request.config
    try:
        settings = _settings(node)
        check_served_board(settings)
        robot = _robot(settings.pop("robot", "") or config.getini(_INI), config)
        folder = tmp_path_factory.mktemp("served")
        board = ServedBoardUnderTest(robot, folder, kernel=steptwin_kernel, **_from_root(settings, robot, config))
    except StepTwinError as error:
        pytest.fail(f"steptwin: {error}", pytrace=False)
    yield board
    stalls = board.end()["real_time"]["stalls"]
    sections = {"bus": last_frames(robot, board.bus_log())}
    if stalls["count"]:
        sections["computer too slow"] = (
            f"the board's clock stood {stalls['count']} times, {stalls['total_ms']:.0f} ms in all"
        )
    _add(node, sections)
    _keep(node, [board.copy], _artefacts(config, tmp_path_factory))


def _settings(node: pytest.Item) -> dict[str, Any]:
    """Return the arguments of the markers of a test, its class and its module; raise InputError for a second name."""
    from steptwin.host.common.errors import InputError

    settings: dict[str, Any] = {}
    for marker in node.iter_markers(_MARKER):  # the closest one first
        if len(marker.args) > 1:
            raise InputError(f"{marker.args[1]!r}: only the robot comes without a name, others are written NAME=VALUE")
        settings = dict(zip(("robot",), marker.args, strict=False)) | dict(marker.kwargs) | settings
    return settings


def _from_root(machine: Mapping[str, Any], robot: "Robot", config: pytest.Config) -> "MachineKeywords":
    """Return a machine's options with the files of features read; relative paths begin at pytest's root directory."""
    from steptwin.host.twin.machine.machine_options import read_extras

    placed: dict[str, Any] = {"extras": read_extras(machine.get("extras", ()), robot, config.rootpath)}
    if isinstance(firmware := machine.get("firmware"), str):
        placed["firmware"] = config.rootpath / firmware
    if nodes := machine.get("nodes"):
        placed["nodes"] = {node_id: config.rootpath / path for node_id, path in nodes.items()}
    return cast("MachineKeywords", {**machine, **placed})


def _robot(robot: Path | str, config: pytest.Config) -> "Robot":
    from steptwin.host.common.errors import InputError
    from steptwin.host.robots import SUFFIX, load_robot, robot_names

    name = str(robot)
    if not robot:
        names = ", ".join(robot_names())
        raise InputError(f'which robot? @pytest.mark.{_MARKER}("ROBOT") or {_INI} in the ini-file; there are {names}')
    return load_robot(str(config.rootpath / name) if name.endswith(SUFFIX) else name)
