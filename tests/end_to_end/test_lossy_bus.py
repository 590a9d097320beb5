"""Flow control under loss: records that vanish are sent again, in order, and the motion does not notice."""

import random

import pytest

from controller.backend import Kernel
from host.embedded import EmbeddedNetwork
from host.errors import BusError
from host.jobs import make_job
from host.planner import plan
from host.robots import load_robot
from host.run import Outcome, execute
from protocol.frame import COB_SYNC

RPDO4 = range(0x510, 0x518)


def run_losing(kernel: Kernel, monkeypatch: pytest.MonkeyPatch, part: float) -> tuple[Outcome, int]:
    """The drawer pull while this part of all PVT records gets lost on the way."""
    generator = random.Random(1)
    lost = 0
    send = EmbeddedNetwork.send_message

    def lossy(network: EmbeddedNetwork, can_id: int, data: bytes, remote: bool = False) -> None:
        nonlocal lost
        if can_id in RPDO4 and generator.random() < part:
            lost += 1
        else:
            send(network, can_id, data, remote)

    monkeypatch.setattr(EmbeddedNetwork, "send_message", lossy)
    robot = load_robot("warehouse-scara")
    planned = plan(robot, make_job(robot, "drawer-pull", {}))
    return execute(planned, "drawer-pull", kernel), lost


@pytest.mark.parametrize("part", [0.002, 0.01, 0.05])
def test_losses_are_made_good(fast_kernel: Kernel, monkeypatch: pytest.MonkeyPatch, part: float) -> None:
    outcome, lost = run_losing(fast_kernel, monkeypatch, part)
    assert lost > 5
    assert outcome.fault is None
    assert outcome.report.passed, outcome.report.reasons


def test_a_line_too_bad_to_keep_up_ends_in_an_underrun(fast_kernel: Kernel, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two of five records get lost: the queues fill before the start, then run dry, and the board stops itself."""
    outcome, _ = run_losing(fast_kernel, monkeypatch, 0.4)
    assert outcome.fault is not None
    assert outcome.fault.positions_agree
    assert 0xFF01 in [code for codes in outcome.fault.codes.values() for code in codes]


def test_a_lost_sync_is_noticed(fast_kernel: Kernel, monkeypatch: pytest.MonkeyPatch) -> None:
    send = EmbeddedNetwork.send_message

    def without_sync(network: EmbeddedNetwork, can_id: int, data: bytes, remote: bool = False) -> None:
        if can_id != COB_SYNC:
            send(network, can_id, data, remote)

    monkeypatch.setattr(EmbeddedNetwork, "send_message", without_sync)
    robot = load_robot("warehouse-scara")
    with pytest.raises(BusError, match="not all axes start within 1 s"):
        execute(plan(robot, make_job(robot, "drawer-pull", {})), "drawer-pull", fast_kernel)


def test_a_dead_line_never_starts(fast_kernel: Kernel, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(BusError, match="32 records"):
        run_losing(fast_kernel, monkeypatch, 1.0)
