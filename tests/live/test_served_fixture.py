"""The fixture `steptwin_served_board`, as a project uses it: a program connects, and a failed test keeps the folder."""

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.host.record.folder import read_report
from steptwin.host.robots import load_robot
from steptwin.host.twin.board_under_test import ServedBoardUnderTest, last_frames

pytest_plugins = ["pytester"]

CODE = """
    import can
    import pytest

    @pytest.mark.steptwin("lab-scara", stand_at={"d1": 20.0})
    @pytest.mark.parametrize("fails", [False, True])
    def test_board(steptwin_served_board, fails):
        board = steptwin_served_board
        with can.Bus("vcan0", interface="socketcand", host=board.host, port=board.port) as bus:
            bus.send(can.Message(arbitration_id=0, data=[1, 0], is_extended_id=False))
            assert bus.recv(20.0)
        assert board.joints()["d1"] == pytest.approx(20.0)
        assert board.end() == board.end()
        assert [frame.cob_id for _, frame in board.bus_log()][4] == 0
        assert board.log.stat().st_size and board.evidence().axes[0].step_counts.size == 0
        assert not fails
    """


@pytest.fixture(autouse=True, scope="module")
def loaded(fast_kernel: Kernel, tmp_path_factory: pytest.TempPathFactory) -> None:
    """Import all that a board needs: pytester forgets a test's first imports, and numba cannot be imported twice."""
    board = ServedBoardUnderTest(load_robot("lab-scara"), tmp_path_factory.mktemp("first"), kernel=fast_kernel)
    last_frames(board.robot, board.bus_log())


def test_a_program_connects_and_a_failed_test_keeps_its_folder(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(CODE)
    result = pytester.runpytest("-p", "no:cacheprovider", "--steptwin-artefacts", "kept")
    result.assert_outcomes(passed=1, failed=1)
    result.stdout.fnmatch_lines(["*Captured steptwin bus (SIMULATED) teardown*", "*NMT*all*start*", "*steptwin view*"])
    (folder,) = pytester.path.joinpath("kept").iterdir()
    assert read_report(folder).run.job == "live"
