"""Scenario files: what each key becomes, and every mistake with its place."""

import json

import pytest

from steptwin.features.faults.kinds import FAULTS
from steptwin.features.faults.kinds.bus import FrameLoss
from steptwin.features.faults.kinds.host import HostFault, HostFaultKind
from steptwin.features.faults.kinds.machine import EmergencyStop
from steptwin.features.faults.kinds.wiring import StuckSwitch
from steptwin.features.faults.reaction import MotionEffect, Reaction
from steptwin.features.faults.scenario import (
    Scenario,
    ScenarioFile,
    TriggeredFault,
    parse_scenario,
    read_scenario,
)
from steptwin.features.faults.triggers import TRIGGERS, AtPosition, AtRandom, AtState, AtTime, Direction, OnFrame
from steptwin.host.cli.app import run
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_models import json_schema
from steptwin.host.common.findings import Findings
from steptwin.protocol.cia402 import DigitalInput, ErrorCode, State
from tests.end_to_end.pages import ROOT
from tests.features.faults.short_runs import ROBOT, scenario
from tests.messages import refusing

STOP = 'do = "estop"\npressed = true\n'


def messages(text: str) -> list[str]:
    findings = Findings()
    parse_scenario(text, ROBOT, findings)
    return findings.messages


def test_every_key() -> None:
    read = scenario(
        """
        name = "all"
        title = "a line"
        seed = 5
        [[fault]]
        name = "first"
        at_position = { joint = "th2", value = 3 }
        do = "switch"
        joint = "th1"
        switch = "-"
        stuck = "open"
        until = { at_state = { joint = "th1", state = "QUICK STOP ACTIVE" } }
        [[fault]]
        at_random = { from_s = 1, to_s = 2.5 }
        do = "loss"
        frames = [0x77F, 0x80]
        rate = 0.5
        skip = 1
        count = 3
        receiver = 1
        for_s = 0.25
        [[fault]]
        on_frame = { id = 0x80 }
        do = "host"
        how = "restart"
        by_s = 2
        expect = { motion = "cut", codes = [0x9000], state = "FAULT", within_ms = 2, certain = false }
        [[fault]]
        power_up_s = 0.5
        do = "estop"
        pressed = false
        until = { at_random = { from_s = 1, to_s = 2 } }
        """
    )
    assert read == Scenario(
        "all",
        (
            TriggeredFault(
                "first",
                AtPosition("th2", 3.0, Direction.ANY),
                StuckSwitch(0, DigitalInput.NEGATIVE_LIMIT, closed=False),
                AtState("th1", State.QUICK_STOP_ACTIVE),
            ),
            TriggeredFault(
                "2 loss",
                AtRandom(1.0, 2.5),
                FrameLoss((0x80, 0x77F), rate=0.5, skip=1, count=3, receiver=1),
                0.25,
            ),
            TriggeredFault(
                "3 host",
                OnFrame(0x80),
                HostFault(HostFaultKind.RESTART, 2.0),
                None,
                Reaction(MotionEffect.CUT, (ErrorCode.ESTOP,), State.FAULT, 2.0, certain=False),
            ),
            TriggeredFault(
                "4 estop", AtTime(0.5, from_power_up=True), EmergencyStop(pressed=False), AtRandom(1.0, 2.0)
            ),
        ),
        seed=5,
    )


def test_random_instants_come_from_the_seed_and_the_fault_alone() -> None:
    random = "at_random = { from_s = 0, to_s = 1000 }\n" + STOP
    two = scenario(f'seed = 1\n[[fault]]\nname = "a"\n{random}[[fault]]\nname = "b"\n{random}').drawn()
    one = scenario(f'seed = 1\n[[fault]]\nname = "b"\n{random}').drawn()
    other = scenario(f'seed = 2\n[[fault]]\nname = "b"\n{random}').drawn()
    assert two.faults[1] == one.faults[0]
    assert len({two.faults[0].trigger, two.faults[1].trigger, other.faults[0].trigger}) == 3
    assert all(isinstance(fault.trigger, AtTime) and 0 <= fault.trigger.at_s <= 1000 for fault in two.faults)


ONE_OF = f"a fault has exactly one of {', '.join(TRIGGERS)}"


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "fault: is missing: a scenario has at least one [[fault]]"),
        ("fualt = 1\n", "fualt: key 'fualt' is unknown: did you mean fault?"),
        (f"seed = -1\n[[fault]]\nat_s = 1\n{STOP}", "seed: -1 is below 0"),
        ("fault = [3]\n", "fault 1: 3 is not a table"),
        (
            f'[[fault]]\nname = "x"\nat_s = 1\n{STOP}[[fault]]\nname = "x"\nat_s = 1\n{STOP}',
            "fault 2: name: 'x' is the name of another fault",
        ),
    ],
)
def test_mistakes(text: str, complaint: str) -> None:
    assert messages(text)[0].startswith(complaint)


@pytest.mark.parametrize(
    ("keys", "complaint"),
    [
        (
            "at_s = 1",
            "do: is missing",
        ),
        (
            'at_s = 1; do = "estpo"',
            "do: 'estpo' is unknown: did you mean estop?",
        ),
        (
            'at_s = 1; do = "state"',
            "do: 'state' is no fault: it changes nothing",
        ),
        (
            "STOP",
            f"{ONE_OF}, not none",
        ),
        (
            "at_s = 1; power_up_s = 1; STOP",
            f"{ONE_OF}, not at_s and power_up_s",
        ),
        (
            "at_s = -1; STOP",
            "at_s: -1.0 s is outside 0..86400 s; the nearest is 0 s",
        ),
        (
            "at_s = 1; for_s = 1; until = { at_s = 2 }; STOP",
            "for_s: a fault has for_s or until, not both",
        ),
        (
            "at_s = 1; until = {}; STOP",
            "until.a fault has exactly one of",
        ),
        (
            'at_s = 1; for_s = 1; do = "slip"; joint = "th1"; full_steps = 4',
            "for_s: this fault has no end: it is over at once",
        ),
        (
            'at_s = 1; for_s = 1; do = "host"; how = "restart"',
            "for_s: this fault has no end: by_s says how long it lasts",
        ),
        (
            'at_s = 1; expect = { motion = "goes-on", state = "FAULT" }; STOP',
            "expect.state: is for a motion that ends; at the end of one that goes on the drives are off",
        ),
        (
            'at_s = 1; for_s = 1; do = "host"; how = "hang"; by_s = 1',
            "for_s: this fault has no end: by_s says how long it lasts",
        ),
        (
            'at_s = 1; for_s = 1; do = "host"; how = "death"',
            "for_s: this fault has no end: the host is gone",
        ),
        (
            'at_s = 1; for_s = 1; do = "osc"; joint = "th1"; osc_pf = 400',
            "for_s: this fault has no end: the part stays as it is",
        ),
        (
            'at_s = 1; do = "host"; how = "death"; by_s = 1',
            "by_s: is for hang, restart, late, not for death",
        ),
        (
            'at_s = 1; do = "host"; how = "late"',
            "by_s: a host that is late by 0 s is not: say by how much, such as 0.05",
        ),
        (
            "at_random = { from_s = 2, to_s = 1 }; STOP",
            "at_random.to_s: 1 s is before from_s, 2 s",
        ),
        (
            'at_position = { joint = "th9", value = 1 }; STOP',
            "at_position.joint 'th9' is unknown: did you mean th4 or th2 or th1?",
        ),
        (
            'at_position = { joint = "th1" }; STOP',
            "at_position.value: is missing",
        ),
        (
            "on_frame = { id = 2048 }; STOP",
            "on_frame.id: 2048 is not an identifier from 0 to 0x7FF",
        ),
        (
            "on_frame = { id = 1, n = 0 }; STOP",
            "on_frame.n: 0 is below 1",
        ),
        (
            'at_state = { joint = "th1", state = "FAULTY" }; STOP',
            "at_state.state: 'FAULTY' is unknown: did you mean FAULT",
        ),
        (
            'at_s = 1; do = "slip"; joint = "th1"; full_steps = 5',
            "full_steps: 5 is not a multiple of 4: a motor slips by whole electrical cycles; the nearest is 4",
        ),
        (
            'at_s = 1; do = "loss"; frames = "recrods"',
            "frames: 'recrods' is unknown: did you mean records?",
        ),
        (
            'at_s = 1; do = "loss"; frames = [3000]',
            "frames: 3000 is not an identifier from 0 to 0x7FF",
        ),
        (
            'at_s = 1; do = "loss"; frames = "sync"; joint = "th1"',
            "joint: th1 has no frames of its own among sync",
        ),
        (
            'at_s = 1; do = "loss"; frames = "all"; rate = 1.5',
            "rate: 1.5 is outside 0..1",
        ),
        (
            'at_s = 1; do = "wire"; joint = "th1"; wire = "step"; condition = "noisy"',
            "rate_hz: is missing: a noisy wire has rate_hz and width_us",
        ),
        (
            'at_s = 1; do = "wire"; joint = "th1"; wire = "step"; condition = "low"; seed = 1',
            "seed: is for a noisy wire, not for one that is low",
        ),
        (
            'at_s = 1; expect = { motion = "goes" }; STOP',
            "expect.motion: 'goes' is unknown: did you mean goes-on?",
        ),
        (
            'at_s = 1; expect = { motion = "cut", codes = [1] }; STOP',
            "expect.codes: 1 is none of the board's error codes, such as 0x9000",
        ),
        (
            'at_s = 1; expect = { motion = "cut", within_ms = -1 }; STOP',
            "expect.within_ms: -1 is negative",
        ),
    ],
)
def test_mistakes_in_a_fault(keys: str, complaint: str) -> None:
    """Keys are on lines of their own; STOP stands for an emergency stop."""
    text = keys.replace("; ", "\n").replace("STOP", STOP)
    assert messages(f"[[fault]]\n{text}\n")[0].startswith(f"fault 1: {complaint}")


def test_all_mistakes_are_found_at_once() -> None:
    found = messages(f"[[fault]]\nat_s = -1\n{STOP}[[fault]]\n{STOP}seed = 2\n")
    assert [line.partition(":")[0] for line in found] == ["fault 1", "fault 2", "fault 2"]


def test_the_example_of_the_page_and_a_file_that_is_not_there() -> None:
    example = ROOT / "docs" / "examples" / "faults" / "carry.toml"
    assert len(read_scenario(str(example), ROBOT).faults) == 3
    with refusing(InputError):
        read_scenario("none.toml", ROBOT)
    with refusing(ValueError):
        Scenario("s", (TriggeredFault("x", AtTime(1), EmergencyStop(pressed=True)),) * 2)


@pytest.mark.slow
def test_the_schema_has_every_fault_with_its_keys() -> None:
    schema = json_schema(ScenarioFile)["properties"]
    faults = {each["properties"]["do"]["const"]: each for each in schema["fault"]["items"]["oneOf"]}
    assert list(faults) == list(FAULTS)
    for do, each in faults.items():
        needed = [name for name, key in FAULTS[do].keys().items() if not key.optional]
        assert each["required"] == ["do", *needed]
        assert set(each["properties"]) == {"do", *FAULTS[do].keys(), *TRIGGERS, "name", "for_s", "until", "expect"}
    voltage = faults["supply"]["properties"]["supply_v"]
    assert (voltage["type"], voltage["minimum"], voltage["maximum"]) == ("number", 0, 655.35)
    assert faults["switch"]["properties"]["stuck"]["enum"] == ["closed", "open", "free"]
    assert schema["seed"]["maximum"] == 2**31 - 1


def test_scenarios_have_a_schema(capsys: pytest.CaptureFixture[str]) -> None:
    """Editors complete them by it: each fault by its `do`."""
    assert run(["schema", "scenario"]) == 0
    schema = json.loads(capsys.readouterr().out)
    assert set(schema["properties"]) == {"fault", "name", "title", "seed"}
    assert all("do" in each["properties"] for each in schema["properties"]["fault"]["items"]["oneOf"])
