"""A shelf with drawers, spots for single boxes, and the hand of a paper's robot that works there."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

from steptwin.host.common.features import Feature, FeatureJudge

if TYPE_CHECKING:
    from steptwin.features.shelf.errand import PlannedStock
    from steptwin.features.shelf.machine import ShelfPart
    from steptwin.features.shelf.options import ShelfOptions
    from steptwin.features.shelf.run import ShelfRun
    from steptwin.features.shelf.section import Shelf
    from steptwin.host.common.tables import Table
    from steptwin.host.planning.jobs.job import Job
    from steptwin.host.planning.motion import Motion
    from steptwin.host.robots.robot import Robot

NAME: Final = "shelf"


def shelf_of(robot: "Robot") -> "Shelf | None":
    """Return a robot's shelf; None if it has none."""
    found: Any = robot.sections.get(NAME)
    shelf: Shelf | None = found
    return shelf


def _section() -> "type[Shelf]":
    from steptwin.features.shelf.section import Shelf

    return Shelf


def _robot_tables(robot: str) -> str:
    path = Path(__file__).parent / "robots" / f"{robot}.toml"
    return path.read_text(encoding="utf-8") if path.is_file() else ""


def _program_keys() -> Mapping[str, Any]:
    from pydantic import Field

    return {"leaves_open": Annotated[tuple[str, ...], Field(description="slots whose drawers stay open at the end")]}


def _check_slots(robot: "Robot", _: str, slots: Sequence[str]) -> None:
    from steptwin.features.shelf.section import check_slots

    check_slots(robot, slots)


def _jobs() -> "Mapping[str, Sequence[Job[Any]]]":
    from steptwin.features.papers import carry, pull_line
    from steptwin.features.shelf.jobs import CARRY_PARTS, DRAWER_PULL, EVERY_SLOT, FETCH, STORE

    return {pull_line.KIND: (DRAWER_PULL, STORE, FETCH, EVERY_SLOT), carry.KIND: (CARRY_PARTS,)}


def _job_extra(_: "Robot", intent: Any) -> "ShelfOptions | None":
    from steptwin.features.shelf.errand import Errand, carries_of
    from steptwin.features.shelf.options import ShelfOptions

    carries = carries_of(intent)
    return ShelfOptions(errand=Errand.alone(carries)) if carries else None


def _check_robot(robot: "Robot") -> Iterable[str]:
    from steptwin.features.shelf.jobs import missed_places, missed_presets

    return [*missed_places(robot), *missed_presets(robot)]


def _check_travel(robot: "Robot", start: Sequence[float], goal: Sequence[float]) -> None:
    if shelf_of(robot) is not None:
        from steptwin.features.shelf.clearance import check_travel

        check_travel(robot, start, goal)


def _machine_options() -> "type[ShelfOptions]":
    from steptwin.features.shelf.options import ShelfOptions

    return ShelfOptions


def _replayed(table: "Table") -> "ShelfOptions | None":
    if NAME not in table:
        return None
    from steptwin.features.shelf.options import ShelfOptions

    with table.section(NAME) as shelf, shelf.section("start") as start:
        return ShelfOptions(stock={place: start.text(place) for place in start})


def _part(
    robot: "Robot",
    joints: Sequence[float],
    axes_per_board: Sequence[int],
    options: "ShelfOptions | None",
    waits_for: Collection[str] | None,
) -> "ShelfPart | None":
    if shelf_of(robot) is None and options is None:
        return None
    from steptwin.features.shelf.machine import shelf_part

    return shelf_part(robot, joints, axes_per_board, options, waits_for)


def _expected(robot: "Robot", motion: "Motion", options: "ShelfOptions | None") -> "PlannedStock | None":
    if shelf_of(robot) is None:
        return None
    from steptwin.features.shelf.errand import expected

    return expected(robot, motion, options)


def _judge() -> FeatureJudge:
    from steptwin.features.shelf import verdict

    return verdict


def _run_options() -> "type[ShelfRun]":
    from steptwin.features.shelf.run import ShelfRun

    return ShelfRun


def _report_lines(document: Mapping[str, Any]) -> Iterable[str]:
    carried = [event for event in document["events"] if event["box"] and not event["fault"]]
    said = (f"{event['what']} {event['where']} {event['t_s']:.3f} s ({event['box']})" for event in carried)
    text = ", ".join(said)
    return [f"{NAME}: {text}"] if text else []


FEATURE: Final = Feature(
    name=NAME,
    needs=("papers",),
    section=_section,
    robot_tables=_robot_tables,
    program_keys=_program_keys,
    check_program=_check_slots,
    jobs=_jobs,
    job_extra=_job_extra,
    check_robot=_check_robot,
    check_travel=_check_travel,
    machine_options=_machine_options,
    replayed=_replayed,
    part=_part,
    expected=_expected,
    judge=_judge,
    run_options=_run_options,
    report_lines=_report_lines,
)
