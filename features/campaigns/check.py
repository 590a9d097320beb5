"""Check the file of a campaign, for `steptwin check`."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from steptwin.features.campaigns.campaign import Campaign, DrawnMotion, ScenarioChoice, parse_campaign
from steptwin.features.campaigns.sources import Sources
from steptwin.host.cli.arguments import CheckedFile
from steptwin.host.cli.output import number_of, print_table, say
from steptwin.host.common.errors import InputError
from steptwin.host.common.findings import Findings


def check_campaign(file: str, text: str, robot_name: str | None, findings: Findings) -> CheckedFile:
    """Check a campaign, which names its robots itself, and the files that it names."""
    with findings.collecting():
        if robot_name is not None:
            raise InputError(f"is a campaign, which names its robots: leave {robot_name} out")
        campaign, _ = parse_campaign(Sources(file, text, folder=Path(file).parent))
        document = _document(campaign)
        return CheckedFile(document, (lambda: _print(document),))
    return CheckedFile()


def _document(campaign: Campaign) -> dict[str, Any]:
    motions, scenarios = campaign.motion, campaign.scenario
    return {
        "runs": campaign.runs,
        "first_seed": campaign.first_seed,
        "robots": list(campaign.robots),
        "motions": _choices(campaign, motions, str),
        "scenarios": [
            told | {"faults": _faults(choice)}
            for told, choice in zip(_choices(campaign, scenarios, lambda choice: choice.name), scenarios, strict=True)
        ],
        "vary": list(campaign.vary),
        "recover": campaign.recover,
        "motors": campaign.motors or "never",
    }


def _choices(
    campaign: Campaign, choices: Sequence[DrawnMotion | ScenarioChoice], name: Callable[[Any], str]
) -> list[dict[str, Any]]:
    """Return of each choice its name, its robots, and the part of all runs that are to have it."""
    weights = dict.fromkeys(campaign.robots, 0.0)
    for choice in choices:
        for robot in choice.robots:
            weights[robot] += choice.weight
    return [
        {
            "name": name(choice),
            "robots": list(choice.robots),
            "share": round(sum(choice.weight / weights[robot] for robot in choice.robots) / len(campaign.robots), 6),
        }
        for choice in choices
    ]


def _faults(choice: ScenarioChoice) -> list[str]:
    """Return what the faults of a scenario do."""
    return [fault["do"] for fault in choice.table.get("fault", ())]


def _print(document: dict[str, Any]) -> None:
    rows = [["motion", each["name"], "", *_whose(document, each)] for each in document["motions"]]
    rows += [
        ["scenario", each["name"], ", ".join(each["faults"]), *_whose(document, each)] for each in document["scenarios"]
    ]
    print_table(["", "", "faults", "robots", "runs"], rows, text_columns=4)
    say(f"varies: {', '.join(document['vary']) or 'nothing'}")
    after = "recovered after each run" if document["recover"] else "not recovered"
    motors = {"never": "", "after": ", motors turn after each run", "loop": ", motors turn as runs go"}
    robots = f"{number_of(len(document['robots']), 'robot')}, {after}{motors[document['motors']]}"
    say(f"campaign of {number_of(document['runs'], 'run')} from seed {document['first_seed']}: {robots}")


def _whose(document: dict[str, Any], choice: dict[str, Any]) -> list[str]:
    """Return the robots of a choice, and how many runs are to have it."""
    whose = "all" if choice["robots"] == document["robots"] else ", ".join(choice["robots"])
    return [whose, f"{choice['share'] * document['runs']:.0f}"]
