"""Faults on purpose: what may go wrong, what starts it, and whether the machine answers as documented."""

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

from steptwin.host.common.features import COMMAND_GROUPS, CommandRow, ControlRequests, Feature, FileKind, Telling

if TYPE_CHECKING:
    from pathlib import Path

    from steptwin.features.faults.options import FaultOptions
    from steptwin.features.faults.part import FaultsPart
    from steptwin.host.cli.arguments import CheckedFile
    from steptwin.host.common.findings import Findings
    from steptwin.host.robots.robot import Robot

NAME: Final = "faults"


def _machine_options() -> "type[FaultOptions]":
    from steptwin.features.faults.options import FaultOptions

    return FaultOptions


def _read_options(options: "FaultOptions", robot: "Robot", folder: "Path") -> "FaultOptions":
    return options.read_for(robot, folder)


def _part(
    robot: "Robot",
    _joints: Sequence[float],
    _axes_per_board: Sequence[int],
    options: "FaultOptions | None",
    _waits_for: Collection[str] | None,
) -> "FaultsPart | None":
    scenario = None if options is None else options.scenario_for(robot)
    if scenario is None:
        return None
    from steptwin.features.faults.part import FaultsPart

    return FaultsPart(scenario)


def _requests() -> ControlRequests:
    from steptwin.features.faults import requests

    return requests


def _check(path: str, text: str, robot: str | None, findings: "Findings") -> "CheckedFile":
    from steptwin.features.faults.check import check_scenario

    return check_scenario(path, text, robot, findings)


def _file_kinds() -> Sequence[FileKind]:
    return (FileKind("scenario", ("fault",), _check),)


def _telling() -> Telling:
    from steptwin.features.faults import report

    return report


def _schemas() -> "Mapping[str, Callable[[], type[Any]]]":
    from steptwin.features.faults.scenario import ScenarioFile

    return {"scenario": lambda: ScenarioFile}


FEATURE: Final = Feature(
    name=NAME,
    machine_options=_machine_options,
    read_options=_read_options,
    part=_part,
    requests=_requests,
    schemas=_schemas,
    file_kinds=_file_kinds,
    telling=_telling,
    commands=(
        CommandRow(
            "inject",
            COMMAND_GROUPS[2],
            "Inject faults into a served board: its inputs, supply, switches, wires, drivers, motors, logic and bus.",
            "steptwin.features.faults.inject",
            usual=False,
        ),
    ),
)
