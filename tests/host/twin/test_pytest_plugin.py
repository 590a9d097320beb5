"""The pytest plugin, as a project uses it that has StepTwin installed."""

import subprocess
import sys

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.host.client.monitor import Decoder
from steptwin.host.record.folder import read_report
from steptwin.host.robots import load_robot
from steptwin.host.twin.fixtures.board_under_test import BoardUnderTest

pytest_plugins = ["pytester"]

HEAVY = [
    *("can", "canopen", "matplotlib", "numba", "numpy", "scipy"),
    *("steptwin.controller", "steptwin.emulator", "steptwin.protocol"),
]


@pytest.fixture(autouse=True, scope="module")
def loaded(fast_kernel: Kernel) -> None:
    """Import all that a board needs: pytester forgets a test's first imports, and numba cannot be imported twice."""
    Decoder({})
    BoardUnderTest(load_robot("lab-scara"), kernel=fast_kernel)


def outcomes(pytester: pytest.Pytester, code: str, *options: str) -> pytest.RunResult:
    """Run tests in a file of their own; return the result."""
    pytester.makepyfile(code)
    return pytester.runpytest("-p", "no:cacheprovider", *options)


def test_the_plugin_alone_imports_nothing_heavy() -> None:
    code = f"import sys, steptwin.host.twin.pytest_plugin; print([name for name in {HEAVY} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


def test_a_board_that_the_marker_names(pytester: pytest.Pytester) -> None:
    """Of several markers the closest one counts, argument by argument."""
    result = outcomes(
        pytester,
        """
        import pytest

        pytestmark = pytest.mark.steptwin("warehouse-scara", stand_at={"L1": 150.0, "th1": -20.0})

        def test_network_and_time(steptwin_board):
            board = steptwin_board
            assert board.robot.name == "warehouse-scara"
            before_s = board.now_s()
            board.wait(2.5)
            assert board.now_s() - before_s == pytest.approx(2.5, abs=0.001)

        @pytest.mark.steptwin(stand_at={"L1": 100.0})
        def test_closest(steptwin_board):
            assert steptwin_board.joints()["L1"] == pytest.approx(100, abs=0.01)
            assert steptwin_board.joints()["th1"] == 0

        def test_module(steptwin_board):
            assert steptwin_board.joints()["th1"] == pytest.approx(-20, abs=0.05)
            assert steptwin_board.steps()["L1"] > 0
        """,
        "--strict-markers",
    )
    result.assert_outcomes(passed=3)


def test_the_ini_file_names_the_robot(pytester: pytest.Pytester) -> None:
    pytester.makeini("[pytest]\nsteptwin_robot = hybrid-arm")
    outcomes(
        pytester,
        """
        def test_robot(steptwin_board):
            assert list(steptwin_board.joints()) == ["th1", "Z5", "Z6", "th4"]
        """,
    ).assert_outcomes(passed=1)


def test_a_robot_file_from_the_root_directory(pytester: pytest.Pytester) -> None:
    """Its path begins at pytest's root directory, wherever pytest is started."""
    toml = load_robot("lab-scara").toml.replace('name = "lab-scara"', 'name = "mine"')
    pytester.path.joinpath("mine.toml").write_text(toml, encoding="utf-8")
    pytester.makeini("[pytest]\nsteptwin_robot = mine.toml")
    below = pytester.mkdir("below")
    below.joinpath("test_below.py").write_text(
        "def test_robot(steptwin_board):\n    assert steptwin_board.robot.name == 'mine'\n", encoding="utf-8"
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(below)
        pytester.runpytest("-p", "no:cacheprovider").assert_outcomes(passed=1)


def test_several_boards(pytester: pytest.Pytester) -> None:
    """Each has a bus and a time of its own."""
    outcomes(
        pytester,
        """
        def test_two(steptwin_make_board):
            one, other = steptwin_make_board("lab-scara"), steptwin_make_board("teaching-scara")
            one.wait(1.0)
            assert one.now_s() > other.now_s() + 0.9
            other.network.send_message(0x000, bytes((1, 0)))
            assert other.bus_log[-1][1].cob_id != one.bus_log[-1][1].cob_id
        """,
    ).assert_outcomes(passed=1)


@pytest.mark.parametrize(
    ("marker", "complaint"),
    [
        ("", 'steptwin: which robot? @pytest.mark.steptwin("ROBOT") or steptwin_robot in the ini-file; there are'),
        ('("lab-skara")', "steptwin: robot 'lab-skara' is unknown: did you mean lab-scara?"),
        ('("no-such.toml")', "no-such.toml: No such file"),
        ('("lab-scara", driver_profile="9a-module")', "steptwin: "),
        ('("lab-scara", stand_at=[0.0])', "steptwin: stand_at: 1 values for the 4 joints d1 th2 th3 th4"),
        ('("lab-scara", stand_at={"th9": 0.0})', "steptwin: stand_at: joint 'th9' is unknown: did you mean th"),
    ],
)
def test_bad_input_is_refused(marker: str, complaint: str, pytester: pytest.Pytester) -> None:
    """The message is one line, without a traceback of StepTwin."""
    line = f"@pytest.mark.steptwin{marker}\n" if marker else ""
    result = outcomes(pytester, f"import pytest\n{line}def test_board(steptwin_board): pass")
    result.assert_outcomes(errors=1)
    assert complaint in result.stdout.str()
    assert "Traceback" not in result.stdout.str()


def test_a_failure_shows_the_last_frames_on_the_bus(pytester: pytest.Pytester) -> None:
    """A test that passes shows none."""
    code = """
        import pytest

        @pytest.mark.steptwin("lab-scara")
        def test_board(steptwin_board):
            steptwin_board.network.send_message(0x000, bytes((1, 0)))
            assert {passes}
        """
    failed = outcomes(pytester, code.replace("{passes}", "False"))
    failed.assert_outcomes(failed=1)
    failed.stdout.fnmatch_lines(["*Captured steptwin bus (SIMULATED) teardown*", "*NMT*all*start*", "*TPDO1*d1*"])
    passed = outcomes(pytester, code.replace("{passes}", "True"))
    passed.assert_outcomes(passed=1)
    assert "steptwin bus" not in passed.stdout.str()


def test_a_failure_with_motors_names_the_homings_that_stall(pytester: pytest.Pytester) -> None:
    steep = load_robot("lab-scara").toml.replace("acceleration = 45.0", "acceleration = 720.0")
    pytester.path.joinpath("steep.toml").write_text(steep)
    code = """
        import pytest

        @pytest.mark.steptwin("steep.toml", motors=True)
        def test_board(steptwin_board):
            assert not steptwin_board
        """
    result = outcomes(pytester, code)
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["*Captured steptwin motors (SIMULATED) teardown*", "th2: homing * at 720*"])


FAILS_AFTER_A_LOSS = """
    import pytest
    from steptwin import FrameDelay, FrameLoss

    LOST = FrameLoss(cob_ids=[0x610], count=1)
    UNUSED = FrameDelay(cob_ids=[0x555], delay_counts=72)

    @pytest.mark.steptwin("lab-scara", scenario=[LOST, UNUSED])
    @pytest.mark.parametrize("fails", [False, True])
    def test_board(steptwin_board, fails):
        assert steptwin_board.struck == []
        steptwin_board.network.send_message(0x610, bytes.fromhex("4000100000000000"))
        ((counts, fault, frame),) = steptwin_board.struck
        assert (counts, fault, frame.cob_id) == (720_000, LOST, 0x610)
        assert not fails
    """


@pytest.fixture
def failed(pytester: pytest.Pytester) -> pytest.RunResult:
    return outcomes(pytester, FAILS_AFTER_A_LOSS, "--steptwin-artefacts", "kept")


def test_a_failure_shows_how_the_faults_of_the_bus_struck(failed: pytest.RunResult) -> None:
    """And which never did: the test may have meant to try them."""
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


def test_the_folder_of_a_failed_test_is_kept(failed: pytest.RunResult, pytester: pytest.Pytester) -> None:
    """That of a test that passes is not."""
    (folder,) = pytester.path.joinpath("kept").iterdir()
    assert folder.name.endswith("py-test_board-True")
    assert str(folder) in failed.stdout.str()
    report = read_report(folder)
    assert (report.run.robot, report.run.job, report.run.bus.frames) == ("lab-scara", "test", 5)


def test_where_they_are_kept_by_default_and_by_the_ini_file(pytester: pytest.Pytester) -> None:
    code = """
        def test_two(steptwin_make_board):
            steptwin_make_board("lab-scara"), steptwin_make_board("teaching-scara")
            assert False
        """
    result = outcomes(pytester, code, "--basetemp", "temporary")
    assert {path.name[-11:] for path in pytester.path.joinpath("temporary", "steptwin").iterdir()} == {
        "py-test_two",
        "-test_two-2",
    }
    result.stdout.fnmatch_lines(["*Captured steptwin run folder (SIMULATED) teardown*", "*steptwin view*"])
    pytester.makeini("[pytest]\nsteptwin_artefacts = by-the-ini-file")
    outcomes(pytester, code)
    assert len(list(pytester.path.joinpath("by-the-ini-file").iterdir())) == 2


def test_a_folder_that_cannot_be_kept_is_told(pytester: pytest.Pytester) -> None:
    pytester.path.joinpath("kept").touch()
    result = outcomes(pytester, FAILS_AFTER_A_LOSS, "--steptwin-artefacts", "kept")
    result.assert_outcomes(failed=1, passed=1)
    result.stdout.fnmatch_lines(["could not be saved: out=*kept*"])


def test_a_served_board_takes_no_schedule(pytester: pytest.Pytester) -> None:
    code = """
        import pytest

        @pytest.mark.steptwin("lab-scara", schedule=[])
        def test_board(steptwin_served_board): pass
        """
    result = outcomes(pytester, code)
    result.assert_outcomes(errors=1)
    assert "steptwin: schedule: is for steptwin_board; a served board takes robot, stand_at" in result.stdout.str()


def test_what_happens_to_the_machine(pytester: pytest.Pytester) -> None:
    """Emergency stop, lost frames, limits of the driver."""
    outcomes(
        pytester,
        """
        import pytest
        from steptwin import EmergencyStop, FrameLoss, Scheduled

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
        @pytest.mark.steptwin(scenario=[FrameLoss(cob_ids=[0x610], count=1)])
        def test_lost_frame(steptwin_board, again):
            ask = lambda: steptwin_board.network.send_message(0x610, bytes.fromhex("4000100000000000"))
            answers = lambda: sum(frame.cob_id == 0x590 for _, frame in steptwin_board.bus_log)
            ask()
            assert answers() == 0
            ask()
            assert answers() == 1

        def test_violations(steptwin_board):
            \"\"\"Pulses of 10 us, where the driver requires 30.\"\"\"
            board = steptwin_board
            write = lambda text: board.network.send_message(0x611, bytes.fromhex(text))
            start(board)
            write("2301200110270000")  # 2001:01 = 10 000 ns
            write("2F60600003000000")  # profile velocity
            for controlword in ("06", "07", "0F"):
                write(f"2B406000{controlword}000000")
            assert board.violations() == []
            before = board.steps()
            write("23FF600000000100")  # 65 536 units/s, 64 steps/s
            board.wait(1.0)
            violations = board.violations()
            assert len(violations) > 10
            assert {violation.joint for violation in violations} == {"th2"}
            assert {violation[2:] for violation in violations} == {("clk_high", 10.0, 30.0, "us")}
            assert len(board.pins("th2").clk_rise_counts) == len(violations)
            assert board.steps() == before
        """,
    ).assert_outcomes(passed=5)
