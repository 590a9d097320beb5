"""Check a node: all checks in their order, each from a node at rest in PRE-OPERATIONAL."""

from collections.abc import Collection, Iterator
from typing import Final

from steptwin.features.conform import (  # noqa: F401  the modules add their checks
    drive_checks,
    file_checks,
    network_checks,
    object_checks,
    pdo_checks,
    sdo_checks,
)
from steptwin.features.conform.check import (
    CHECKS,
    Checked,
    CheckResult,
    ConformanceCheck,
    DiffersError,
    FailedError,
    Need,
    SkippedError,
)
from steptwin.features.conform.node import DEVICE_TYPE, HEARTBEAT_MS, HEARTBEAT_TIME, AbortError, NodeUnderTest
from steptwin.host.common.errors import InputError
from steptwin.protocol.cia402 import DISABLE_VOLTAGE, State
from steptwin.protocol.frame import COB_SDO_REQUEST
from steptwin.protocol.nmt import NmtCommand, NmtState
from steptwin.protocol.sdo_frames import upload_request

_LISTENED_S: Final = 0.3
_POWERED: Final = (State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE, State.FAULT_REACTION_ACTIVE)
ORDER: Final = "EDSPYTMHNRF"
"""Letters of the groups in the order in which they are checked: those that reset the node come late."""


def ordered() -> list[ConformanceCheck]:
    """Return all checks in their order."""
    return sorted(CHECKS, key=lambda check: (ORDER.index(check.id[0]), int(check.id[1:])))


def conformance(node: NodeUnderTest, given: Collection[Need], only: Collection[str] = ()) -> Iterator[Checked]:
    """Check a node; yield each check when it is done. Afterwards the node is as it was, but for what a reset loses.

    Args:
        node: the node.
        given: what the checks may use.
        only: ids of checks, or letters of groups; empty: all.

    Raises:
        InputError: the node does not answer, its drive is on, or another SDO client talks to it.
    """
    chosen = [check for check in ordered() if not only or check.id in only or check.id[0] in only]
    on_bus = [check for check in chosen if check.group != "EDS"]
    before = _begin(node) if on_bus else b""
    try:
        for check in chosen:
            node.traffic.clear()
            yield _checked(node, check, given)
    finally:
        if on_bus:
            node.command(NmtCommand.ENTER_PRE_OPERATIONAL)
            node.write_code(HEARTBEAT_TIME, before)


def _begin(node: NodeUnderTest) -> bytes:
    """Prepare a node; return its heartbeat time as it was."""
    place = f"node 0x{node.node_id:02X}"
    node.wait(_LISTENED_S)
    if node.since(0, COB_SDO_REQUEST + node.node_id):
        raise InputError(f"{place}: another SDO client talks to it; end that first")
    node.command(NmtCommand.ENTER_PRE_OPERATIONAL)
    if node.request(upload_request(DEVICE_TYPE)) is None:
        raise InputError(f"{place}: does not answer an SDO request within a second; is its id right?")
    if node.is_drive and (state := node.drive_state()) in _POWERED:
        raise InputError(f"{place}: the drive is in {state.name}; switch it off first")
    before = node.upload(HEARTBEAT_TIME)
    node.produce_heartbeat()
    return before


def _checked(node: NodeUnderTest, check: ConformanceCheck, given: Collection[Need]) -> Checked:
    result, reason = CheckResult.PASSED, ""
    if check.need is not Need.NOTHING and check.need not in given:
        return Checked(check, CheckResult.SKIPPED, f"needs {check.need.value}", ())
    try:
        check.run(node)
    except (FailedError, AbortError) as error:
        result, reason = CheckResult.FAILED, str(error)
    except DiffersError as error:
        result, reason = CheckResult.DIFFERS, str(error)
    except SkippedError as error:
        result, reason = CheckResult.SKIPPED, str(error)
    if check.group != "EDS":
        _settle(node)
    return Checked(check, result, reason, tuple(node.traffic))


def _settle(node: NodeUnderTest) -> None:
    """Bring the node back to PRE-OPERATIONAL, its drive off and its heartbeat running."""
    try:
        node.enter(NmtState.PRE_OPERATIONAL)
    except FailedError:
        node.command(NmtCommand.ENTER_PRE_OPERATIONAL)
        node.write_code(HEARTBEAT_TIME, HEARTBEAT_MS.to_bytes(2, "little"))
    if node.is_drive and node.drive_state() in _POWERED:
        node.control(DISABLE_VOLTAGE)
        if not node.reached(State.SWITCH_ON_DISABLED):
            node.reset(NmtCommand.RESET_NODE)
