"""A few sessions of the random host, the sessions that once failed, and proof that the random host sees faults."""

from collections import deque
from pathlib import Path

import pytest

from steptwin.controller.modes.profile_velocity import ProfileVelocity
from steptwin.controller.motion import kernel as k
from steptwin.controller.motion.axis_motion import AxisMotion
from steptwin.controller.motion.backend import Kernel
from steptwin.emulator.operations import Operation
from steptwin.protocol import od
from steptwin.protocol.cia402 import ENABLE_OPERATION, SHUTDOWN, SWITCH_ON, Mode
from steptwin.protocol.frame import COB_NMT, COB_SDO_REQUEST, FIRST_NODE_ID, Frame
from tests.compiled import on_sources_only
from tests.emulator.random_host import queues, working_move
from tests.emulator.random_host.machine import Machine
from tests.emulator.random_host.sdo import download
from tests.emulator.random_host.session import BusOff, Pause, PowerCycle, Session, Setup, Step, machine_board
from tests.emulator.random_host.shrink import shrunk
from tests.emulator.random_host.trial import REPEATED, fault_of, trial
from tests.emulator.simulations import MS, STEP
from tests.operations import EmergencyStop

pytestmark = on_sources_only
CASES = sorted((Path(__file__).parent / "cases").glob("*.jsonl"))
"""Sessions that once failed, shortened; docs/evidence.md says how."""
OTHERS = [*range(9, 32), REPEATED]
"""Sessions that `make test` leaves out."""


@pytest.mark.parametrize("seed", [*range(1, 9), *(pytest.param(seed, marks=pytest.mark.slow) for seed in OTHERS)])
def test_random_sessions_hold(seed: int) -> None:
    outcome = trial(seed)
    assert not outcome.fault, f"python -m tests.emulator.random_host --seed {seed} --shrink"


@pytest.mark.parametrize("case", CASES, ids=lambda path: path.stem)
def test_sessions_that_once_failed_hold(case: Path) -> None:
    assert fault_of(Session.load(case)) == ""


def test_a_session_makes_pulses() -> None:
    assert sum(trial(seed).pulses for seed in (2, 3)) > 1000


def test_the_same_seed_gives_the_same_session() -> None:
    assert trial(3).session == trial(3).session


def test_a_session_survives_its_file(tmp_path: Path) -> None:
    path = tmp_path / "session.jsonl"
    session = trial(3).session
    steps = (*session.steps[:-1], Step(session.steps[-1].at_counts, PowerCycle()), *session.steps[-1:])
    session = Session(session.setup, (Step(0, BusOff()), *steps))
    session.save(path)
    assert Session.load(path) == session


class TestSight:
    """With a fault put into the firmware, the random host says which."""

    @pytest.mark.parametrize("case", CASES, ids=lambda path: path.stem)
    def test_enable_falls_within_a_pulse(self, case: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(AxisMotion, "last_fall_counts", k.NEVER_COUNTS)
        assert "ENABLE becomes 0" in fault_of(Session.load(case))

    def test_an_old_target_moves_an_axis(self, monkeypatch: pytest.MonkeyPatch) -> None:
        assert fault_of(enabled_twice()) == ""
        monkeypatch.setattr(ProfileVelocity, "void_target", lambda _mode: None)
        assert "axis 0 sets off without a target" in fault_of(enabled_twice())

    def test_a_queue_grows(self, fast_kernel: Kernel) -> None:
        board = Machine(enabled_twice().setup, fast_kernel).board
        assert list(queues.overgrown(board)) == []
        board.firmware.nodes[0].drive.supervision.__dict__["_waiting"] = deque(range(queues.QUEUE_PLACES_MAX + 1))
        (fault,) = queues.overgrown(board)
        assert fault == "Firmware.nodes[].drive.supervision._waiting holds 161, more than 160"

    def test_a_machine_does_not_come_back(self, monkeypatch: pytest.MonkeyPatch) -> None:
        def pressed(_axis_count: int) -> tuple[Operation, ...]:
            return (EmergencyStop(pressed=True),)

        monkeypatch.setattr(working_move, "restoring", pressed)
        assert "is not homed" in trial(1).fault


def enabled_twice() -> Session:
    """A jog that is ended by disabling the drive, and the drive enabled again."""
    writes: list[tuple[int, int]] = [(od.MODE_OF_OPERATION, Mode.PROFILE_VELOCITY)]
    writes += [(od.CONTROLWORD, word) for word in (SHUTDOWN, SWITCH_ON, ENABLE_OPERATION)]
    writes += [(od.TARGET_VELOCITY, 100 * STEP), (od.CONTROLWORD, SWITCH_ON), (od.CONTROLWORD, ENABLE_OPERATION)]
    frames = [Frame(COB_SDO_REQUEST + FIRST_NODE_ID, download(*write)) for write in writes]
    steps = [Step((i + 1) * 100 * MS, frame) for i, frame in enumerate([Frame(COB_NMT, b"\x01\x00"), *frames])]
    setup = Setup(1_000_000, machine_board(0, (), (0,)))
    return Session(setup, (*steps, Step(1000 * MS, Pause())))


@pytest.mark.slow
def test_shrinking_leaves_only_what_is_needed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ProfileVelocity, "void_target", lambda _mode: None)
    session = enabled_twice()
    needless = [Step(step.at_counts + MS, Frame(0x123, b"")) for step in session.steps]
    longer = Session(session.setup, tuple(sorted((*session.steps, *needless[:-1]), key=lambda step: step.at_counts)))
    shorter = shrunk(longer, lambda tried: "sets off" in fault_of(tried))
    assert set(shorter.steps) < set(session.steps)
