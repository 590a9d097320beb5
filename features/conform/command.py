"""`steptwin conform --node ID --connect ...`: check a CANopen node against CiA 301 and CiA 402."""

from pathlib import Path
from typing import Any, Final
from xml.etree import ElementTree as ET

from steptwin.features.conform.check import CHECKS, Checked, CheckResult, Need
from steptwin.host.cli.app import command, end_unless
from steptwin.host.cli.arguments import AnswerOptions, Replace, keep_files
from steptwin.host.cli.live.connection import BoardAddress
from steptwin.host.cli.options import option, switch
from steptwin.host.cli.output import print_table, say
from steptwin.host.common.bad_input import prefixed, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.common.numbers import digits_in
from steptwin.host.common.whole_file import write_whole
from steptwin.protocol.frame import NODE_ID_MAX

_SHOWN_FRAMES: Final = 6


@command(
    "--node 0x10 --connect 127.0.0.1 --only S --only P",
    "--node 3 -i socketcan -c can0 --enable --only F",
)
def conform(
    answer: AnswerOptions,
    address: BoardAddress,
    node: str | None = option("ID", "Id of the node, such as 3 or 0x10."),
    eds: str | None = option("FILE", "The node's EDS or DCF: it is checked, and the node is compared with it."),
    only: list[str] | None = option("ID", "Only this check, such as S6, or this group, such as S; repeatable."),
    enable: bool = switch("Switch the drive on for some checks; it is not moved."),
    motion: bool = switch("Move the axis a little for some checks, too; it must be free."),
    junit: Path | None = option("FILE", "Write the results as JUnit XML, for CI."),
    replace: Replace = False,
) -> None:
    """Check a CANopen node against CiA 301 and CiA 402; exit code 1 if it fails.

    The checks are grouped as CiA's conformance test groups them (docs/masters.md). Nothing moves without --motion. A
    check passes, fails, or differs: the node does what the standard allows, but others do not. A check that the node
    or the options do not allow is skipped, and says why. What a check changes is written back. The node is reset, so
    its drive must be off, and no other master may talk to it.
    """
    from steptwin.features.conform.conformance import conformance, ordered
    from steptwin.features.conform.node import Description, NodeUnderTest
    from steptwin.host.client.links.bus_link import BusLink, open_bus

    node_id = _node_id(node)
    names = {check.id for check in ordered()} | {check.id[0] for check in CHECKS}
    for name in only or []:
        if name not in names:
            raise unknown("--only", name, sorted(names))
    if junit is not None:
        keep_files([junit], replace=replace)
    connection = address.required(None)
    described = None
    if eds is not None:
        with prefixed(f"{eds}: "):
            described = Description.read(eds, node_id)
    given = {Need.EDS: eds is not None, Need.ENABLE: enable or motion, Need.MOTION: motion}
    with BusLink(open_bus(connection), connection.title) as link:
        under_test = NodeUnderTest(link, node_id, described)
        results = list(conformance(under_test, [need for need, has in given.items() if has], only or []))
    counts = {result: sum(each.result is result for each in results) for result in CheckResult}
    if junit is not None:
        write_whole(junit, junit_text(results))
    document: dict[str, Any] = {
        "node": node_id,
        "eds": eds,
        "counts": {result.name.lower(): count for result, count in counts.items()},
        "checks": [
            {
                "id": each.check.id,
                "group": each.check.group,
                "clause": each.check.clause,
                "title": each.check.title,
                "result": each.result.name.lower(),
                "reason": each.reason,
                "frames": [str(frame) for frame in each.traffic] if each.result is CheckResult.FAILED else [],
            }
            for each in results
        ],
    }
    answer.tell(document, lambda: print_results(results))
    end_unless(not counts[CheckResult.FAILED])


def _node_id(text: str | None) -> int:
    if text is None:
        raise InputError("which node? --node ID, such as --node 0x10")
    try:
        node_id = int(text, 16) if text.lower().startswith("0x") else digits_in(text)
    except ValueError:
        node_id = None
    if node_id is None or not 1 <= node_id <= NODE_ID_MAX:
        raise InputError(f"--node {text}: a node id is from 1 to {NODE_ID_MAX}, or from 0x01 to 0x{NODE_ID_MAX:02X}")
    return node_id


def print_results(results: list[Checked]) -> None:
    """Print a row for each check, the last frames of those that fail, and the counts."""
    rows = [[each.check.id, each.check.clause, each.result, each.reason or each.check.title] for each in results]
    print_table(["check", "clause", "result", "what"], rows, text_columns=4)
    for each in results:
        if each.result is CheckResult.FAILED and each.traffic:
            say(f"{each.check.id} {each.check.title}: its last frames", *map(str, each.traffic[-_SHOWN_FRAMES:]))
    counts = (f"{sum(each.result is result for each in results)} {result.name.lower()}" for result in CheckResult)
    say(", ".join(counts))


def junit_text(results: list[Checked]) -> str:
    """Return the results as JUnit XML; what differs passes, with its reason as output."""
    failures = sum(each.result is CheckResult.FAILED for each in results)
    skipped = sum(each.result is CheckResult.SKIPPED for each in results)
    suite = ET.Element(
        "testsuite", name="steptwin conform", tests=f"{len(results)}", failures=f"{failures}", skipped=f"{skipped}"
    )
    for each in results:
        name = f"{each.check.id} {each.check.title}"
        case = ET.SubElement(suite, "testcase", classname=f"conform.{each.check.group}", name=name)
        if each.result is CheckResult.FAILED:
            failure = ET.SubElement(case, "failure", message=each.reason)
            failure.text = "\n".join(map(str, each.traffic))
        elif each.result is CheckResult.SKIPPED:
            ET.SubElement(case, "skipped", message=each.reason)
        elif each.reason:
            ET.SubElement(case, "system-out").text = each.reason
    ET.indent(suite)
    return ET.tostring(suite, encoding="unicode") + "\n"
