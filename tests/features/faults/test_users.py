"""Who uses scenarios beside `execute`: the command `run`, a live board, the board for tests, `check`."""

import json
import re
import runpy
from pathlib import Path

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.features.faults import NAME
from steptwin.features.faults.kinds.host import HostFault, HostFaultKind
from steptwin.features.faults.kinds.machine import EmergencyStop
from steptwin.features.faults.options import FaultOptions
from steptwin.features.faults.scenario import Scenario, TriggeredFault
from steptwin.features.faults.triggers import AtState, AtTime
from steptwin.host.cli.app import run
from steptwin.host.common.errors import InputError
from steptwin.host.twin.board_under_test import BoardUnderTest, parts_in_words
from steptwin.host.twin.live.live_board import LiveBoard
from steptwin.host.twin.machine.machine_options import MachineOptions
from steptwin.protocol.cia402 import State
from steptwin.protocol.frame import FIRST_NODE_ID, Frame
from tests.end_to_end.pages import read_page
from tests.features.faults.short_runs import ROBOT, played, scenario
from tests.messages import refusing

STOP = 'name = "stop"\nat_s = 0.4\ndo = "estop"\npressed = true\n'
LATE = 'name = "never"\nat_s = 9\ndo = "supply"\nsupply_v = 12\n'


def written(folder: Path, *faults: str) -> str:
    """Write a scenario's file; return its path."""
    path = folder / "faults.toml"
    path.write_text('name = "ours"\n' + "".join(f"[[fault]]\n{fault}" for fault in faults))
    return str(path)


@pytest.mark.slow
def test_verify_says_which_faults_a_run_had(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What is wrong with a run may have been meant."""
    out = str(tmp_path / "out")
    run(["run", "teaching-scara", "carry", "--machine", f"faults={written(tmp_path, STOP, LATE)}", "--out", out])
    capsys.readouterr()
    assert run(["verify", out]) == 3
    printed = capsys.readouterr().out
    assert printed.endswith(
        "STOPPED BY A FAULT\nfault on purpose: stop, struck at 0.400 s\nfault on purpose: never, never struck\n"
    )
    assert run(["verify", out, "--json"]) == 3
    document = json.loads(capsys.readouterr().out)
    assert document["faults"] == [{"name": "stop", "struck_s": 0.4}, {"name": "never", "struck_s": None}]


@pytest.mark.slow
def test_run_says_what_answered(tmp_path: Path, capsys: pytest.CaptureFixture[str], fast_kernel: Kernel) -> None:
    """A motion that is stopped as documented is a success of the scenario: exit code 0."""
    command = ["run", "teaching-scara", "carry", "--kernel", fast_kernel.name, "--machine"]
    assert run([*command, f"faults={written(tmp_path, STOP)}"]) == 0
    printed = capsys.readouterr().out
    assert "teaching-scara carry: STOPPED BY A FAULT\n" in printed
    assert printed.endswith("scenario ours: PASSED, 1 of 1 faults struck, seed 0\n")

    assert run([*command, f"faults={written(tmp_path, STOP, LATE)}", "--json"]) == 1
    document = json.loads(capsys.readouterr().out)
    assert document["passed"] is False
    assert document["scenario"] == {
        "name": "ours",
        "seed": 0,
        "passed": False,
        "reasons": ["never: never struck: at 9 s: the motion ended at 0.518 s, before at_s 9"],
    }
    stop, never = document["faults"]
    assert (stop["struck_s"], stop["strikes"], stop["as_documented"]) == (0.4, 1, True)
    assert {told["code"] for told in stop["emcys"]} == {"0x9000"}
    assert stop["joints"]["th1"] == {"state": "FAULT", "position_known": True, "lost_steps": 0.0}
    assert stop["documented"]["codes"] == ["0x9000"]
    assert (never["struck_s"], never["strikes"], never["documented"]) == (None, 0, None)
    assert never["do"] == {"do": "supply", "supply_v": 12.0}


def test_run_refuses_what_is_wrong(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = written(tmp_path, STOP.replace("estop", "estpo"))
    assert run(["run", "teaching-scara", "carry", "--machine", f"faults={path}"]) == 2
    assert capsys.readouterr().err == f"steptwin: {path}: fault 1: do: 'estpo' is unknown: did you mean estop?\n"
    assert run(["run", "teaching-scara", "carry", "--machine", f"faults={path}", "--connect", "127.0.0.1"]) == 2
    assert "--machine faults: is for a run in virtual time" in capsys.readouterr().err
    heavy = written(tmp_path, 'at_s = 0.1\ndo = "payload"\npayload_kg = 2.5\n')
    assert run(["run", "teaching-scara", "carry", "--machine", f"faults={heavy}"]) == 2
    assert capsys.readouterr().err == (
        "steptwin: 1 payload: payload_kg: 2.5 kg: only motors that turn with the board feel it:"
        " run --motors=loop, serve --machine motors, or MotorOptions in a test\n"
    )


def test_check_shows_the_faults(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = written(tmp_path, STOP, LATE + "for_s = 2\n")
    assert run(["check", path, "teaching-scara"]) == 0
    rows = [" ".join(line.split()) for line in capsys.readouterr().out.splitlines()]
    assert rows[2] == "stop at 0.4 s estop pressed=true to the end"
    assert rows[3] == "never at 9 s supply supply_v=12 for 2 s"
    assert run(["check", path]) == 2
    assert "which robot?" in capsys.readouterr().err
    assert run(["check", written(tmp_path, "at_s = -1\n" + LATE), "teaching-scara"]) == 2


def test_a_live_board_plays_a_scenario(fast_kernel: Kernel) -> None:
    """Four axes on two boards: the button stops all of them when one is enabled, and is pulled out 20 ms later."""
    stop = TriggeredFault("stop", AtState("th4", State.OPERATION_ENABLED), EmergencyStop(pressed=True), 0.02)
    board = LiveBoard(
        ROBOT,
        fast_kernel,
        MachineOptions(
            axes_per_board=(2, 2),
            extras=[
                FaultOptions(
                    scenario=Scenario("live", (stop, TriggeredFault("later", AtTime(1.0), EmergencyStop(pressed=True))))
                )
            ],
            bitrate=1_000_000,
        ),
    )
    board.live.start(0, 0)
    now_ns = 0

    def wait(dt_ms: int) -> None:
        nonlocal now_ns
        for _ in range(dt_ms):
            now_ns += 1_000_000
            board.live.advance(now_ns)

    board.live.send(Frame(0x000, b"\x01\x00"), "a client", now_ns)
    for word in (0x06, 0x07, 0x0F):
        for axis in range(4):
            board.live.send(Frame(0x200 + FIRST_NODE_ID + axis, bytes((word, 0, 7))), "a client", now_ns)
        wait(5)
    nodes = [node for each in board.live.simulation.boards for node in each.firmware.nodes]
    assert [node.drive.state for node in nodes] == [State.FAULT] * 4
    assert board.environment.emergency_stop
    wait(20)
    assert not board.environment.emergency_stop
    document = board.report()
    assert document["scenario"] == {"name": "live", "seed": 0}
    first, later = document["faults"]
    assert {told["code"] for told in first["emcys"]} == {"0x9000"}
    assert first["ended_s"] - first["struck_s"] == pytest.approx(0.02)
    assert (later["struck_s"], later["strikes"]) == (None, 0)


def test_a_live_board_has_no_host_of_its_own(fast_kernel: Kernel) -> None:
    dying = Scenario("dying", (TriggeredFault("it", AtTime(1), HostFault(HostFaultKind.DEATH)),))
    with refusing(InputError):
        LiveBoard(ROBOT, fast_kernel, MachineOptions(extras=[FaultOptions(scenario=dying)]))


def test_a_board_for_tests_plays_a_scenario(tmp_path: Path, fast_kernel: Kernel) -> None:
    path = written(tmp_path, 'name = "press"\npower_up_s = 0.05\ndo = "estop"\npressed = true\n', LATE)
    board = BoardUnderTest(ROBOT, kernel=fast_kernel, extras=[FaultOptions(scenario=path)])
    assert [fault["strikes"] for fault in board.happened()[NAME]] == [0, 0]
    board.wait(0.1)
    press, never = board.happened()[NAME]
    assert (press["struck_s"], press["emcys"], never["struck_s"]) == (0.05, [], None)
    assert (press["strikes"], never["strikes"]) == (1, 0)
    told = parts_in_words(board)[NAME].splitlines()
    assert told == [
        "press: at 0.05 s from power-up: struck at 0.050000 s, 1 times, no EMCY",
        "never: at 9 s: never struck, 0 times, no EMCY",
    ]
    assert BoardUnderTest(ROBOT, kernel=fast_kernel).happened() == {}
    with refusing(InputError):
        wrong = FaultOptions(scenario=written(tmp_path, "at_s = -1\n" + STOP.partition("0.4\n")[2]))
        BoardUnderTest(ROBOT, kernel=fast_kernel, extras=[wrong])


@pytest.mark.slow
def test_the_same_scenario_gives_the_same_bytes(fast_kernel: Kernel) -> None:
    text = """
        seed = 11
        [[fault]]
        at_random = { from_s = 0, to_s = 0.2 }
        do = "loss"
        frames = "records"
        rate = 0.02
        [[fault]]
        at_random = { from_s = 0.3, to_s = 0.6 }
        do = "wire"
        joint = "th1"
        wire = "step"
        condition = "noisy"
        rate_hz = 300
        width_us = 40
        for_s = 0.1
        """
    runs = [played(fast_kernel, text) for _ in range(2)]
    assert runs[0][1].to_dict() == runs[1][1].to_dict()
    assert runs[0][0].bus_log == runs[1][0].bus_log
    assert scenario(text).drawn() != scenario(text.replace("seed = 11", "seed = 12")).drawn()


def test_the_python_of_the_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, _, _ = re.findall(r"^```python\n(.*?)^```", read_page("docs/faults.md"), flags=re.MULTILINE | re.DOTALL)
    program = tmp_path / "program.py"
    program.write_text(code)
    runpy.run_path(str(program))
    assert 100 < float(capsys.readouterr().out) < 200
