"""What StepTwin itself has recorded is replayed: every frame at its microsecond, every edge at its count."""

import shutil
from functools import partial
from pathlib import Path

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.emulator.operations import Scheduled
from steptwin.features.faults.kinds.bus import BusOff, HostBitRate, RogueFrame
from steptwin.features.faults.kinds.machine import EmergencyStop, SetInput, WatchdogReset
from steptwin.features.faults.options import FaultOptions
from steptwin.features.faults.scenario import Scenario, TriggeredFault
from steptwin.features.faults.triggers import AtTime
from steptwin.features.replay.command import print_result
from steptwin.features.replay.power_up import MachineAtPowerUp, stored_machine
from steptwin.features.replay.replaying import Replayed, replay
from steptwin.host.common.errors import InputError
from steptwin.host.record.folder import BUS_LOG, RECORDING, read_robot, read_run
from steptwin.host.record.recorded_bus import read_bus
from steptwin.host.robots import load_robot
from steptwin.host.twin.board_under_test import BoardUnderTest
from steptwin.protocol.cia402 import DigitalInput
from steptwin.protocol.frame import Frame
from tests.features.faults.short_runs import played
from tests.host.twin.live.live_session import (
    JOINT,
    NMT_START,
    PROFILE_POSITION,
    ROBOT,
    SYNC,
    THERE_AND_BACK,
    LiveSession,
    control,
    enable,
    queue,
    start_at_sync,
)
from tests.messages import refusing


def replayed(folder: Path, kernel: Kernel) -> Replayed:
    robot = read_robot(folder)
    stored = stored_machine(folder, robot)
    return replay(read_bus(folder / BUS_LOG), robot, stored.power_up, kernel, stored)


def move(session: LiveSession) -> None:
    """Move an axis there and back, each frame at an odd nanosecond; let it begin to move elsewhere."""
    session.send(NMT_START)
    session.now_ns += 123_457
    session.move(0)
    session.now_ns += 777
    write = Frame(0x600 + 0x10 + JOINT, bytes.fromhex("237a600000c80000"))
    session.send(*enable(PROFILE_POSITION), write, control(0x1F, PROFILE_POSITION))
    session.wait(10)


def operate(session: LiveSession) -> None:
    """Let a rogue node speak, set the bit rate for 2 ms; stop the axis; close another one's sensor; reset its board."""
    for fault in (RogueFrame(Frame(0x7F0, b"\x01")), BusOff(5), HostBitRate(500_000), HostBitRate(1_000_000)):
        session.board.live.call(partial(session.board.operate, fault), session.now_ns)
        session.wait(2)
    session.board.live.call(lambda: session.board.operate(EmergencyStop(pressed=True)), session.now_ns + 5_001)
    session.wait(50)
    session.board.live.call(lambda: session.board.operate(SetInput(4, DigitalInput.IN1, on=True)), session.now_ns)
    session.wait(20)
    session.board.live.call(lambda: session.board.operate(WatchdogReset(axis=5)), session.now_ns)
    session.wait(20)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("axes_per_board", "crystals_ppm"),
    [(None, ()), ((4, 2), ()), ((4, 2), (100, -100))],
    ids=["one board", "two boards", "two crystals"],
)
def test_a_live_board(
    axes_per_board: tuple[int, ...] | None, crystals_ppm: tuple[int, ...], fast_kernel: Kernel, tmp_path: Path
) -> None:
    """Although its hosts' frames come whenever they come, and the machine is operated beside the bus."""
    session = LiveSession(fast_kernel, tmp_path, axes_per_board=axes_per_board, crystals_ppm=crystals_ppm)
    move(session)
    operate(session)
    session.end()
    result = replayed(tmp_path, fast_kernel)
    assert result.frames is None
    assert result.edges is None
    assert result.against == tmp_path
    assert len(result.machine.simulation.boards) == len(axes_per_board or [6])
    assert [board.config.crystal_ppm for board in result.machine.simulation.boards if crystals_ppm] == [*crystals_ppm]


def test_the_scenario_of_a_live_board(fast_kernel: Kernel, tmp_path: Path) -> None:
    """The faults come while the axis moves: two boards, of which the second is reset."""
    faults = (
        TriggeredFault("stop", AtTime(0.06), EmergencyStop(pressed=True), until=0.02),
        TriggeredFault("reset", AtTime(0.07), WatchdogReset(axis=4)),
    )
    scenario = Scenario("a stop and a reset", faults)
    session = LiveSession(fast_kernel, tmp_path, axes_per_board=(4, 2), extras=[FaultOptions(scenario=scenario)])
    move(session)
    session.end()
    done = [(each["do"], each.get("joint")) for each in session.board.report()["operations"]]
    assert done == [("estop", None), ("watchdog", "th2"), ("estop", None)]
    result = replayed(tmp_path, fast_kernel)
    assert result.frames is None
    assert result.edges is None


def test_a_recording_without_its_end(fast_kernel: Kernel, tmp_path: Path) -> None:
    """It knows no operations on the machine, which are in the report."""
    session = LiveSession(fast_kernel, tmp_path)
    move(session)
    session.board.record()
    log = tmp_path / BUS_LOG
    log.write_bytes(log.read_bytes() + b"(0000000000.3")
    assert (tmp_path / RECORDING).is_dir()
    result = replayed(tmp_path, fast_kernel)
    assert result.bus.cut
    assert result.equal


@pytest.fixture(scope="module")
def saved(fast_kernel: Kernel, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a test's board: a move by records, after a pause of half a microsecond more than whole ones."""
    folder = tmp_path_factory.mktemp("saved")
    board = BoardUnderTest(
        ROBOT,
        stand_at={"th1": 12.0},
        kernel=fast_kernel,
        schedule=[Scheduled(12_000_001, SetInput(4, DigitalInput.IN1, on=True))],
        driver_profile="3a-module",
    )
    board.wait(0.1234565)
    board.network.send_message(*NMT_START)
    for frame in (*enable(), *queue(*THERE_AND_BACK), start_at_sync(), SYNC):
        board.network.send_message(*frame)
        board.wait(0.001)
    board.wait(0.12)
    board.save(folder)
    return folder


def test_a_board_of_a_test(saved: Path, fast_kernel: Kernel) -> None:
    result = replayed(saved, fast_kernel)
    assert result.equal
    assert result.machine.bus_log[-1][1] == read_bus(saved / BUS_LOG).frames[-1].frame
    stored = stored_machine(saved, ROBOT)
    assert stored.power_up.options.driver_profile == "3a-module"
    assert [operated.counts for operated in stored.power_up.operations] == [12_000_001]


def test_the_folder_of_a_tests_board_has_its_plan(saved: Path) -> None:
    run = read_run(saved)
    assert run.report.run.job == "test"
    assert run.duration_s == 0.1
    assert (saved / "trace.vcd").exists()


@pytest.mark.slow
def test_a_replay_is_saved_as_the_run_was(saved: Path, fast_kernel: Kernel, tmp_path: Path) -> None:
    result = replayed(saved, fast_kernel)
    result.run.save(tmp_path)
    for name in (BUS_LOG, "trajectory.csv", "trace.vcd"):
        assert (tmp_path / name).read_bytes() == (saved / name).read_bytes()
    assert read_run(tmp_path).report.run.job == "replay"
    assert replayed(tmp_path, fast_kernel).equal


def altered(saved: Path, folder: Path, old: str, new: str) -> Path:
    """Copy a folder, with another text in place of the first of its kind in the bus log."""
    shutil.copytree(saved, folder)
    text = (saved / BUS_LOG).read_text()
    assert old in text
    (folder / BUS_LOG).write_text(text.replace(old, new, 1))
    return folder


def test_a_record_of_another_length(saved: Path, fast_kernel: Kernel, tmp_path: Path) -> None:
    """21 steps there instead of 20: each edge is earlier."""
    folder = altered(saved, tmp_path / "altered", "513#005000", "513#005400")
    result = replayed(folder, fast_kernel)
    assert not result.equal
    assert result.edges
    assert result.edges.where == "th1 DIR"
    assert result.edges.recorded.startswith("at 0.1")
    assert result.frames
    assert result.frames.where == "on the bus"
    assert "TPDO" in result.frames.recorded


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "193#",
            "193#FF",
            "on the bus: recorded TPDO1 th1 Statusword",
        ),
        ("710#00", "710#7F", "recorded HEARTBEAT sx PRE-OPERATIONAL, replayed HEARTBEAT sx boot-up"),
        ("(0000000000.000113)", "(0000000000.000114)", " at 0.000114 s, replayed HEARTBEAT sz boot-up"),
    ],
)
def test_a_frame_of_the_board_that_differs(
    old: str, new: str, words: str, saved: Path, fast_kernel: Kernel, tmp_path: Path
) -> None:
    result = replayed(altered(saved, tmp_path / "altered", old, new), fast_kernel)
    assert result.edges is None
    assert words in str(result.frames)


def test_a_log_of_another_robots_nodes(tmp_path: Path, fast_kernel: Kernel) -> None:
    log = tmp_path / "other.log"
    log.write_text("(0.1) can0 1A0#01\n(0.2) can0 620#4000100000000000\n(0.3) can0 000#0100\n")
    robot = load_robot("lab-scara")
    with refusing(InputError):
        replay(read_bus(log), robot, MachineAtPowerUp(), fast_kernel)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "bus_faults"),
    [
        ('at_s = 0.4\ndo = "estop"\npressed = true', ()),
        pytest.param(
            'at_position = { joint = "th1", value = -20 }\ndo = "supply"\nsupply_v = 8\nfor_s = 0.1',
            (),
            marks=pytest.mark.slow,
        ),
        ('at_s = 0.3\ndo = "slip"\njoint = "th2"\nfull_steps = 8', ()),
        ('at_s = 0.3\ndo = "host"\nhow = "death"', ()),
        ('at_s = 0.3\ndo = "rogue-node"\nid = 0x211\ndata = "02 00 07"', ()),
        ('at_s = 0.3\ndo = "loss"\nframes = "records"\njoint = "th1"\ncount = 1', ("1 loss (loss)",)),
    ],
    ids=["emergency stop", "supply at a position", "slip", "host", "rogue-node", "bus"],
)
def test_a_scenario(
    fault: str, bus_faults: tuple[str, ...], fast_kernel: Kernel, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """What was done to the machine is done again; a fault of the bus is not, as no log has it, and that is said."""
    outcome, _ = played(fast_kernel, f"[[fault]]\n{fault}\n")
    outcome.save(tmp_path)
    result = replayed(tmp_path, fast_kernel)
    assert result.bus_faults == bus_faults
    assert result.equal == (not bus_faults)
    print_result(result)
    why = "not repeated, because no log shows them: 1 loss (loss): what differs may differ for that"
    assert (why in capsys.readouterr().out.splitlines()) == bool(bus_faults)
