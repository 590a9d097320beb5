"""What has become of a scenario's faults so far, without a judgement: for boards that go on."""

from typing import Any

from steptwin.host.twin.control.operations import request_of
from steptwin.host.twin.scenarios.answers import answers, seconds, told
from steptwin.host.twin.scenarios.engine import Engine, Played


def played_document(engine: Engine) -> dict[str, Any]:
    """Return what has become of each fault so far, under the keys of report.json, without a judgement.

    A live board has no end and no plan of its own: how hosts answer is their own affair.
    """
    scenario = engine.scenario
    return {
        "scenario": {"name": scenario.name, "seed": scenario.seed},
        "faults": [_fault(engine, each) for each in engine.played],
    }


def _fault(engine: Engine, played: Played) -> dict[str, Any]:
    fault, began = played.fault, played.began
    emcys = () if began is None else told(engine, answers(engine, began), began)
    return {
        "name": fault.name,
        "do": request_of(engine.target.robot, fault.harm),
        "due": str(fault.trigger),
        "struck_s": _rounded_s(engine, played.first_counts),
        "strikes": played.strikes,
        "ended_s": _rounded_s(engine, played.ended_counts),
        "emcys": [each.to_dict() for each in emcys],
    }


def _rounded_s(engine: Engine, counts: int | None) -> float | None:
    return None if counts is None else round(seconds(engine, counts), 6)
