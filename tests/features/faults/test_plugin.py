"""Faults in tests that use the pytest plugin."""

import pytest

from steptwin.controller.motion.backend import Kernel
from tests.host.twin.plugin_runs import load_all, outcomes

pytest_plugins = ["pytester"]


@pytest.fixture(autouse=True, scope="module")
def loaded(fast_kernel: Kernel) -> None:
    load_all(fast_kernel)


def test_what_is_no_scenario_is_refused(pytester: pytest.Pytester) -> None:
    code = """
        import pytest
        from steptwin import FaultOptions

        @pytest.mark.steptwin("lab-scara", extras=[FaultOptions(scenario=["estop"])])
        def test_board(steptwin_board): pass
        """
    result = outcomes(pytester, code)
    result.assert_outcomes(errors=1)
    assert "steptwin: scenario: ['estop'] is not Scenario or Sequence[Fault] or Path" in result.stdout.str()
    assert "Traceback" not in result.stdout.str()


FAILS_AFTER_A_LOSS = """
    import pytest
    from steptwin import FaultOptions, FrameDelay, FrameLoss

    LOST = FrameLoss(cob_ids=[0x610], count=1)
    UNUSED = FrameDelay(cob_ids=[0x555], delay_counts=72)

    @pytest.mark.steptwin("lab-scara", extras=[FaultOptions(scenario=[LOST, UNUSED])])
    @pytest.mark.parametrize("fails", [False, True])
    def test_board(steptwin_board, fails):
        assert steptwin_board.struck == []
        steptwin_board.network.send_message(0x610, bytes.fromhex("4000100000000000"))
        ((counts, fault, frame),) = steptwin_board.struck
        assert (counts, fault, frame.cob_id) == (720_000, LOST, 0x610)
        assert not fails
    """


@pytest.mark.slow
def test_a_failure_shows_how_the_faults_of_the_bus_struck(pytester: pytest.Pytester) -> None:
    """And which never did: the test may have meant to try them."""
    failed = outcomes(pytester, FAILS_AFTER_A_LOSS)
    failed.assert_outcomes(failed=1, passed=1)
    failed.stdout.fnmatch_lines(
        [
            "*Captured steptwin faults of the bus (SIMULATED) teardown*",
            "*0.0100* loss: SDO*d1*1000:00 Device type read",
            "*Captured steptwin faults (SIMULATED) teardown*",
            "1 loss: at 0 s from power-up: struck at 0.010000 s, 1 times, no EMCY",
            "2 delay: at 0 s from power-up: never struck, 0 times, no EMCY",
        ]
    )


@pytest.mark.slow
def test_what_happens_to_the_machine(pytester: pytest.Pytester) -> None:
    """Emergency stop and lost frames."""
    outcomes(
        pytester,
        """
        import pytest
        from steptwin import EmergencyStop, FaultOptions, FrameLoss, Scheduled

        pytestmark = pytest.mark.steptwin("lab-scara")

        def inputs(board):
            frames = [frame for _, frame in board.bus_log if frame.cob_id == 0x490]
            return frames[-1].data[:4] if frames else None

        def start(board):
            board.network.send_message(0x000, bytes((1, 0)))

        @pytest.mark.steptwin(schedule=[Scheduled(72_000_000, EmergencyStop(pressed=True))])
        def test_schedule(steptwin_board):
            start(steptwin_board)
            steptwin_board.wait(0.9)
            before = inputs(steptwin_board)
            steptwin_board.wait(0.2)
            assert before != inputs(steptwin_board) == bytes((0, 0, 1, 0))

        def test_now(steptwin_board):
            start(steptwin_board)
            steptwin_board.operate(EmergencyStop(pressed=True))
            steptwin_board.wait(0.1)
            assert inputs(steptwin_board) == bytes((0, 0, 1, 0))

        @pytest.mark.parametrize("again", [1, 2])
        @pytest.mark.steptwin(extras=[FaultOptions(scenario=[FrameLoss(cob_ids=[0x610], count=1)])])
        def test_lost_frame(steptwin_board, again):
            ask = lambda: steptwin_board.network.send_message(0x610, bytes.fromhex("4000100000000000"))
            answers = lambda: sum(frame.cob_id == 0x590 for _, frame in steptwin_board.bus_log)
            ask()
            assert answers() == 0
            ask()
            assert answers() == 1
        """,
    ).assert_outcomes(passed=4)
