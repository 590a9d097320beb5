"""Give the tests of other projects an emulated board in virtual time, as a pytest plugin (docs/ci.md).

pytest imports this module at every start where StepTwin is installed, so everything else is imported only when a test
asks for a board.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from steptwin.controller.backend import Kernel
    from steptwin.emulator.bus_faults import BusFault
    from steptwin.emulator.operations import Scheduled
    from steptwin.host.robots.robot import Robot
    from steptwin.host.twin.board_under_test import BoardUnderTest
    from steptwin.host.twin.standing import Standing

    MakeBoard = Callable[..., BoardUnderTest]

_MARKER = "steptwin"
_INI = "steptwin_robot"
_FRAMES_SHOWN = 20


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the setting that names the robot of tests without one."""
    parser.addini(_INI, "StepTwin: the robot of `steptwin_board`, a name or the path of a robot file", default="")


def pytest_configure(config: pytest.Config) -> None:
    """Register the marker."""
    config.addinivalue_line(
        "markers",
        f"{_MARKER}(robot, stand_at, schedule, bus_faults, driver_profile, dip_microsteps): which board"
        " `steptwin_board` is",
    )


@pytest.fixture(scope="session")
def steptwin_kernel() -> "Kernel":
    """Return the fastest form of the firmware's kernel, loaded once in a session."""
    from steptwin.controller.backend import fastest_kernel

    return fastest_kernel()


@pytest.fixture
def steptwin_make_board(request: pytest.FixtureRequest, steptwin_kernel: "Kernel") -> "Iterator[MakeBoard]":
    """Return a function that switches boards on, each on a bus of its own, for tests that need several.

    Its arguments, all optional:
        robot: the robot's name, or the path of a robot file from pytest's root directory; else the ini-file's robot.
        stand_at: joint positions at which the machine stands, mm and degrees: all, or some by name; else its home.
        schedule: operations on the machine beside its motion, each with its instant.
        bus_faults: faults by which the bus loses, disturbs or delays frames.
        driver_profile: name of the drivers that the board has instead of those in the robot's file.
    """
    from steptwin.host.common.errors import InputError
    from steptwin.host.twin.board_under_test import BoardUnderTest

    boards: list[BoardUnderTest] = []

    def make(
        robot: str = "",
        *,
        stand_at: "Standing | None" = None,
        schedule: "Iterable[Scheduled]" = (),
        bus_faults: "Sequence[BusFault]" = (),
        driver_profile: str | None = None,
        dip_microsteps: "Mapping[str, int] | None" = None,
    ) -> BoardUnderTest:
        try:
            board = BoardUnderTest(
                _robot(robot or request.config.getini(_INI), request.config),
                stand_at=stand_at,
                kernel=steptwin_kernel,
                schedule=schedule,
                bus_faults=bus_faults,
                driver_profile=driver_profile,
                dip_microsteps=dip_microsteps,
            )
        except InputError as error:
            pytest.fail(f"steptwin: {error}", pytrace=False)
        boards.append(board)
        return board

    yield make
    for board in boards:
        request.node.add_report_section("teardown", "steptwin bus (SIMULATED)", _last_frames(board))
        if mismatches := board.mismatches():
            settings = "\n".join(map(str, mismatches))
            request.node.add_report_section("teardown", "steptwin settings (SIMULATED)", settings)


@pytest.fixture
def steptwin_board(request: pytest.FixtureRequest, steptwin_make_board: "MakeBoard") -> "BoardUnderTest":
    """Return an emulated board in virtual time, as the markers `steptwin` of the test, its class and its module say."""
    settings: dict[str, Any] = {}
    for marker in request.node.iter_markers(_MARKER):  # the closest comes first
        settings = dict(zip(("robot",), marker.args, strict=False)) | marker.kwargs | settings
    return steptwin_make_board(**settings)


def _robot(name: str, config: pytest.Config) -> "Robot":
    from steptwin.host.common.errors import InputError
    from steptwin.host.robots import SUFFIX, load_robot, robot_names

    if not name:
        names = ", ".join(robot_names())
        raise InputError(f'which robot? @pytest.mark.{_MARKER}("ROBOT") or {_INI} in the ini-file; there are {names}')
    return load_robot(str(config.rootpath / name) if name.endswith(SUFFIX) else name)


def _last_frames(board: "BoardUnderTest") -> str:
    """Return the last frames on the bus in CANopen's words, shown beside a test's failure."""
    from steptwin.host.client.monitor import Decoder
    from steptwin.protocol.frame import FIRST_NODE_ID
    from steptwin.protocol.timer import COUNTS_PER_SECOND

    decoder = Decoder(dict(enumerate(board.robot.joint_names, start=FIRST_NODE_ID)))
    lines = []
    for counts, frame in board.bus_log[-_FRAMES_SHOWN:]:
        decoded = decoder.decode(frame.cob_id, frame.data)
        lines.append(f"{counts / COUNTS_PER_SECOND:10.6f} {decoded.title:9} {decoded.node:8} {decoded.text}")
    return "\n".join(lines)
