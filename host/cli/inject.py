"""`steptwin inject ROBOT WHAT [VALUE] --control ...`: operate the emulated machine of a served board."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, Final, NamedTuple

import typer

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import LEVELS, AsJson, RobotFile, finite_number, robot_and_rest
from steptwin.host.cli.connection import LIVE_PANEL, host_and_port
from steptwin.host.cli.output import print_json, print_table, say
from steptwin.host.common.bad_input import unknown
from steptwin.host.common.control import EXAMPLE_PORT, SWITCHES, Do, Stuck
from steptwin.host.common.errors import InputError

if TYPE_CHECKING:
    from steptwin.host.client.control_state import ControlState, Lateness, Protect, SwitchState


class _Kind(NamedTuple):
    """What can be asked for.

    Attributes:
        values: the words behind its name.
        ask: asks for it with these words; returns the state after it.
        said: returns what has become of it, in a line.
    """

    values: tuple[str, ...]
    ask: "Callable[..., ControlState]"
    said: "Callable[..., str]"


_HOST: Final = "host"
_KINDS: Final = {
    "estop": _Kind(
        ("on|off",),
        lambda client, level: client.emergency_stop(pressed=_level(level)),
        lambda state, _: _estop(state),
    ),
    "supply": _Kind(
        ("VOLTS",),
        lambda client, volts: client.supply(finite_number(volts, "supply")),
        lambda state, _: _supply(state),
    ),
    "temperature": _Kind(
        ("DEGC",),
        lambda client, degc: client.temperature(finite_number(degc, "temperature")),
        lambda state, _: _temperature(state),
    ),
    "protect": _Kind(
        ("JOINT", "on|off"),
        lambda client, joint, level: client.protect(joint, held=_level(level)),
        lambda state, joint, _: f"Protect of {joint}: {_protect(state.protect[joint])}",
    ),
    "input": _Kind(
        ("NAME", "on|off"),
        lambda client, name, level: client.set_input(name, on=_level(level)),
        lambda state, name, _: f"input {name}: {_on(state.inputs[name])}",
    ),
    "switch": _Kind(
        ("JOINT", "-|+|home", "closed|open|free"),
        lambda client, joint, name, stuck: client.switch(joint, name, _stuck(stuck)),
        lambda state, joint, name, _: f"switch {name} of {joint}: {_switch(state.switches[joint][name])}",
    ),
    "slip": _Kind(
        ("JOINT", "FULL_STEPS"),
        lambda client, joint, steps: client.ask(Do.SLIP, joint=joint, full_steps=_whole(steps, "slip")),
        lambda _, joint, steps: f"the motor of {joint} has slipped by {steps} full steps",
    ),
    "wire": _Kind(
        ("JOINT", "step|dir|enable", "whole|broken|low|high"),
        lambda client, joint, wire, condition: client.ask(Do.WIRE, joint=joint, wire=wire, condition=condition),
        lambda _, joint, wire, condition: f"wire {wire} of {joint}: {condition}",
    ),
    "brown-out": _Kind(
        ("MS",),
        lambda client, ms: client.ask(Do.BROWN_OUT, for_ms=_whole(ms, "brown-out")),
        lambda _, ms: f"no supply for the boards' logic for {ms} ms",
    ),
    "watchdog": _Kind(
        (), lambda client: client.ask(Do.WATCHDOG), lambda _: "the watchdog has reset the boards' processors"
    ),
    "duplicate": _Kind(
        ("FRAMES",),
        lambda client, frames: client.ask(Do.DUPLICATE, frames=frames),
        lambda _, frames: f"{frames}: twice from now on",
    ),
    "loss": _Kind(
        ("FRAMES",),
        lambda client, frames: client.ask(Do.LOSS, frames=frames),
        lambda _, frames: f"{frames}: lost from now on",
    ),
    "corruption": _Kind(
        ("FRAMES",),
        lambda client, frames: client.ask(Do.CORRUPTION, frames=frames),
        lambda _, frames: f"{frames}: disturbed from now on",
    ),
    "delay": _Kind(
        ("FRAMES", "SECONDS"),
        lambda client, frames, seconds: client.ask(Do.DELAY, frames=frames, by_s=finite_number(seconds, "delay")),
        lambda _, frames, seconds: f"{frames}: delayed by {seconds} s from now on",
    ),
    "bus-off": _Kind(
        ("JOINT|host",),
        lambda client, who: client.ask(Do.BUS_OFF, **({} if who == _HOST else {"joint": who})),
        lambda _, who: f"{_station(who)} is in bus-off",
    ),
    "bus-ok": _Kind((), lambda client: client.ask(Do.BUS_OK), lambda _: "all faults of the bus have ended"),
    "state": _Kind((), lambda client: client.state(), lambda _: ""),
}


@command(
    "lab-scara estop on --control 127.0.0.1:29537",
    "lab-scara switch d1 + closed --control 127.0.0.1:29537",
    negatives=True,
)
def inject(
    words: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="ROBOT WHAT [VALUE]",
            help="The robot, and one of: " + "; ".join(" ".join((name, *kind.values)) for name, kind in _KINDS.items()),
        ),
    ] = None,
    robot_file: RobotFile = None,
    control: Annotated[
        str | None,
        typer.Option(
            "--control",
            metavar="HOST:PORT",
            help="Control port of the board, as `steptwin serve --control-port` prints it.",
            rich_help_panel=LIVE_PANEL,
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Harm a served board: its e-stop, supply, sensors, switches that stick, wires, motors and bus.

    What is pressed, held, stuck, broken or lost remains so when the command has ended, until its opposite; `bus-ok`
    ends the faults of the bus. FRAMES are all, sync, nmt, host-heartbeat, of-host, or a service of all nodes: records,
    commands, requests, answers, reports, emergencies, heartbeats.
    """
    from steptwin.host.client.control_client import ControlClient

    loaded, rest = robot_and_rest(words or [], robot_file)
    name, values = _asked_for(rest)
    if control is None:
        raise InputError("which board? --control HOST:PORT, as `steptwin serve --control-port` prints it")
    with ControlClient(*host_and_port("--control", control, EXAMPLE_PORT)) as client:
        before = client.state()
        if before.robot != loaded.name:
            raise InputError(f"{client.title}: the board is one of {before.robot}, not of {loaded.name}")
        state = before if name == "state" else _KINDS[name].ask(client, *values)
    if as_json:
        print_json(dict(state.document))
    elif name != "state":
        say(f"SIMULATED {state.robot}: {_KINDS[name].said(state, *values)}")
    else:
        _print_state(state)


def _asked_for(words: list[str]) -> tuple[str, list[str]]:
    """Return what is asked for and the words behind it; raise InputError unless they are as many as it needs."""
    if not words:
        raise InputError(f"WHAT is missing: {', '.join(_KINDS)}")
    name, *values = words
    if name not in _KINDS:
        raise unknown("WHAT", name, _KINDS)
    needed = _KINDS[name].values
    if len(values) != len(needed):
        raise InputError(f"after {name}: {' '.join(needed) or 'nothing'}, not {' '.join(values) or 'nothing'}")
    return name, values


def _level(text: str) -> bool:
    if text not in LEVELS:
        raise InputError(f"'{text}' is neither on nor off")
    return LEVELS[text]


def _whole(text: str, what: str) -> int:
    value = finite_number(text, what)
    if not value.is_integer():
        raise InputError(f"{what}: {text} is not a whole number")
    return int(value)


def _station(who: str) -> str:
    return "the host" if who == _HOST else f"the board of {who}"


def _stuck(text: str) -> Stuck:
    if text not in list(Stuck):
        raise InputError(f"'{text}' is not one of {', '.join(Stuck)}")
    return Stuck(text)


# --- the state in words


def _print_state(state: "ControlState") -> None:
    say(
        f"SIMULATED {state.robot}: {state.simulated_s:.1f} s, bus load {state.bus_load_percent:.1f} %",
        *(text(state) for text in (_estop, _supply, _temperature)),
    )
    if state.inputs:
        say(f"inputs: {', '.join(f'{name} {_on(on)}' for name, on in state.inputs.items())}")
    for what, late in (("ticks", state.ticks), ("frames", state.frames)):
        say(f"{what} late, ms (p50 p99 max): {_in_ms(late)}")
    rows = [
        [joint, _protect(pin), *(_fitted(state.switches[joint].get(name)) for name in SWITCHES)]
        for joint, pin in state.protect.items()
    ]
    print_table(["joint", "Protect", *SWITCHES], rows, text_columns=2 + len(SWITCHES))


def _estop(state: "ControlState") -> str:
    return f"emergency stop: {'pressed' if state.estop else 'released'}"


def _supply(state: "ControlState") -> str:
    return f"supply: {state.supply_v:.2f} V"


def _temperature(state: "ControlState") -> str:
    return f"board: {state.temperature_degc:.1f} degC"


def _protect(pin: "Protect") -> str:
    if pin.held:
        return "held low"
    return "low: too hot" if pin.low else "free"


def _fitted(switch: "SwitchState | None") -> str:
    return _switch(switch) if switch else "none"


def _switch(switch: "SwitchState") -> str:
    return f"{'stuck ' if switch.stuck else ''}{'closed' if switch.closed else 'open'}"


def _on(level: bool) -> str:
    return "on" if level else "off"


def _in_ms(late: "Lateness") -> str:
    return " ".join(f"{us / 1000:.2f}" for us in (late.late_us_p50, late.late_us_p99, late.late_us_max))
