"""`steptwin check evening.toml`: everything that is wrong in a campaign, or how many runs meet what."""

from pathlib import Path
from random import Random

import pytest

from steptwin.features.campaigns import campaign
from steptwin.host.planning.motion import Motion
from steptwin.host.robots.robot import Robot
from tests.end_to_end.command_line import run_json
from tests.features.campaigns.campaigns import SMALL


def test_a_campaign_tells_how_many_runs_meet_what(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "small.toml"
    file.write_text(SMALL.replace('name = "nothing"', 'name = "nothing"\nweight = 2'), encoding="utf-8")
    told = run_json(capsys, "check", str(file))
    assert (told["kind"], told["runs"], told["robots"], told["vary"]) == (
        "campaign",
        6,
        ["teaching-scara"],
        ["record_ms"],
    )
    shares = {each["name"]: (each["faults"], each["share"]) for each in told["scenarios"]}
    assert shares == {"emergency stop": (["estop"], 0.333333), "nothing": ([], 0.666667)}
    assert [(each["name"], each["share"]) for each in told["motions"]] == [("random moves", 1.0)]


def test_everything_that_is_wrong_is_told_at_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "small.toml"
    text = SMALL.replace("moves = 1", "moves = 0").replace("pressed = true", "press = true")
    file.write_text(text.replace("record_ms", "records_ms"), encoding="utf-8")
    assert run_json(capsys, "check", str(file), exit_code=2)["findings"] == [
        "motion 1: moves: 0 is not a whole number of at least 1",
        "scenario 1: teaching-scara: fault 1: press: key 'press' is unknown: did you mean pressed?",
        "vary: parameter 'records_ms' is unknown: did you mean record_ms?",
    ]
    told = run_json(capsys, "check", str(file), "lab-scara", exit_code=2)["findings"]
    assert told == ["is a campaign, which names its robots: leave lab-scara out"]


def test_many_scenarios_are_checked_in_one_motion_of_the_robot(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A motion planned for each of twenty thousand took a quarter of an hour."""
    planned: list[str] = []
    moves = campaign.random_moves

    def counted(robot: Robot, count: int, reach: float, random: Random) -> Motion:
        planned.append(robot.name)
        return moves(robot, count, reach, random)

    monkeypatch.setattr(campaign, "random_moves", counted)
    head = SMALL[: SMALL.index("[[scenario]]")]
    fault = '[[scenario]]\nname = "{}"\n[[scenario.fault]]\ndo = "estop"\npressed = true\nat_s = 0.1\n'
    file = tmp_path / "many.toml"
    file.write_text(head + "".join(fault.format(number) for number in range(200)), encoding="utf-8")
    told = run_json(capsys, "check", str(file))
    assert (len(told["scenarios"]), told["scenarios"][-1]["share"]) == (200, 0.005)
    assert planned == ["teaching-scara"]
