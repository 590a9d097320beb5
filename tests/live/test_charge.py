"""Programs that contend for a served board, and boards of other robots: each program a process of its own."""

import subprocess

from steptwin.host.client.links.bus_link import BusLink, Connection, open_bus
from steptwin.host.operate.session import Session
from steptwin.host.robots import load_robot
from steptwin.protocol import od
from steptwin.protocol.od import CHARGE_FREE
from tests.emulator.live.live_rig import TIMEOUT_S, await_true
from tests.end_to_end.charge_race import HOME, ONE_RUNS, ROBOT, exit_codes
from tests.end_to_end.served import Server, in_real_time, kept_serving, serving

TRIALS = 2
"""`python -m tests.end_to_end.charge_race 200` makes more."""


def ended(command: subprocess.Popen[str]) -> tuple[int, str]:
    """Wait for a command; return its exit code and what it said on stderr."""
    _, err = command.communicate(timeout=TIMEOUT_S)
    return command.returncode, err


@in_real_time
def test_of_two_runs_begun_at_once_one_runs() -> None:
    with kept_serving(ROBOT) as server:
        assert list(exit_codes(server, TRIALS, seed=1)) == [ONE_RUNS] * TRIALS


@in_real_time
def test_a_killed_program_blocks_nobody() -> None:
    """It is missed after 350 ms; the machine is free and in fault then, and a reset and a move work."""
    with kept_serving(ROBOT) as server:
        assert server.run("home", ROBOT, "--here", HOME) == 0
        with BusLink(open_bus(Connection("socketcand", None, None, "127.0.0.1", server.port)), "the server") as link:
            first = Session(link, load_robot(ROBOT)).machine.axes[0]
            jogging = server.start("jog", ROBOT, "th1", "-1deg/s")
            await_true(lambda: first.read(od.CHARGE_TOKEN) != CHARGE_FREE, "the jog takes charge")
            code, said = ended(server.start("move", ROBOT, "th1=1"))
            assert (code, said.partition(",")[0]) == (4, "steptwin: another program is in charge of the machine")
            jogging.kill()
            ended(jogging)
            await_true(lambda: first.read(od.CHARGE_TOKEN) == CHARGE_FREE, "the board forgets the killed program")
        assert server.run("reset", ROBOT) == 0
        assert server.run("move", ROBOT, "th1=1") == 0


@in_real_time
def test_an_emergency_stop_lasts_until_the_reset() -> None:
    with kept_serving(ROBOT) as server:
        assert server.run("home", ROBOT, "--here", HOME) == 0
        assert server.run("estop", ROBOT) == 0
        held = (3, "steptwin: sx: is held by an emergency stop until `steptwin reset`\n")
        assert ended(server.start("run", ROBOT, "pull-line", "--approach")) == held
        assert ended(server.start("move", ROBOT, "th1=1")) == held
        assert server.run("reset", ROBOT) == 0
        assert server.run("move", ROBOT, "th1=1") == 0


@in_real_time
def test_another_robots_commands_move_nothing() -> None:
    with serving("teaching-scara") as server:
        refused = "steptwin: d1: node 0x10 belongs to the robot teaching-scara, not to lab-scara; "
        for words in (("home", "lab-scara"), ("status", "lab-scara"), ("jog", "lab-scara", "d1", "1")):
            code, said = ended(server.start(*words))
            assert (code, said.partition("--force")[0]) == (2, refused)
        assert _never_enabled(server)


def _never_enabled(server: Server) -> bool:
    return all(axis["state"] == "SWITCH ON DISABLED" for axis in server.json("status", "teaching-scara")["axes"])
