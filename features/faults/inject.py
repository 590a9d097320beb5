"""`steptwin inject ROBOT WHAT [VALUE] --control ...`: operate the emulated machine of a served board."""

from typing import TYPE_CHECKING, Final

from steptwin.features.faults.kinds.machine import BoardTemperature, EmergencyStop, Supply
from steptwin.features.faults.kinds.wiring import protect_text, switch_text
from steptwin.features.faults.requests import INJECTED, REQUESTS, end_of, request_of_words, usage
from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import RobotOptions
from steptwin.host.cli.live.connection import host_and_port, live_option
from steptwin.host.cli.options import argument
from steptwin.host.cli.output import print_table, say
from steptwin.host.common.choices import EXAMPLE_PORT, LEVELS, STATE, SWITCHES
from steptwin.host.common.errors import InputError

if TYPE_CHECKING:
    from steptwin.host.client.control_client import ControlState, LatenessReport, SwitchState


_WHAT: Final = "The robot, and one of:\n" + "\n".join(f"{do} {usage(do)}".rstrip() for do in INJECTED)


@command(
    "lab-scara estop on --control 127.0.0.1:29537",
    "lab-scara switch d1 + closed --control 127.0.0.1:29537",
    negatives=True,
)
def inject(
    which: RobotOptions,
    words: list[str] | None = argument(
        "ROBOT WHAT [VALUE]",
        _WHAT,
    ),
    control: str | None = live_option(
        "HOST:PORT", "Control port of the board, as `steptwin serve --control-port` prints it."
    ),
) -> None:
    """Inject faults into a served board: its inputs, supply, switches, wires, drivers, motors, logic and bus.

    What is in brackets may be left out, and stands as KEY=VALUE or, in this order, without its key. What is pressed,
    held, stuck, broken or lost remains so when the command has ended, which says what ends it; `bus-ok` ends the faults
    of the bus and babble. FRAMES are all, sync, nmt, host-heartbeat, of-host, of-board, a service of all nodes
    (records, commands, requests, answers, reports, emergencies, heartbeats), or identifiers such as 0x510,0x511.
    """
    from steptwin.host.client.control_client import ControlClient

    loaded, rest = which.robot_and_rest(words)
    do, values = request_of_words(rest)
    if control is None:
        raise InputError("which board? --control HOST:PORT, as `steptwin serve --control-port` prints it")
    with ControlClient(*host_and_port("--control", control, EXAMPLE_PORT)) as client:
        before = client.state()
        if before.robot != loaded.name:
            raise InputError(f"{client.title}: the board is one of {before.robot}, not of {loaded.name}")
        state = before if do == STATE else client.ask(do, **values)

    def in_words() -> None:
        if do == STATE:
            _print_state(state)
            return
        fault = REQUESTS[do]
        message = (fault and fault.shown(state, values)) or f"{' '.join(rest)}: done"
        end = end_of(do, values)
        say(f"SIMULATED {state.robot}: {message}{f'; it lasts until {end}' if end else ''}")

    which.tell(dict(state.document), in_words)


# --- state as text


def _rates(state: "ControlState") -> str:
    """Return a note on the host's bit rate if it differs from that of the bus."""
    if state.host_bitrate == state.bitrate:
        return ""
    return f", the host at {state.host_bitrate // 1000} kbit/s instead of {state.bitrate // 1000}"


_LEVELS: Final = {on: word for word, on in LEVELS.items()}


def _print_state(state: "ControlState") -> None:
    say(
        f"SIMULATED {state.robot}: {state.simulated_s:.1f} s, bus load {state.bus_load_percent:.1f} %{_rates(state)}",
        *(fault.shown(state, {}) for fault in (EmergencyStop, Supply, BoardTemperature)),
    )
    if state.inputs:
        say(f"inputs: {', '.join(f'{name} {_LEVELS[on]}' for name, on in state.inputs.items())}")
    for what, late in (("ticks", state.ticks), ("frames", state.frames)):
        say(f"{what} late, ms (p50 p99 max): {_in_ms(late)}")
    rows = [
        [joint, protect_text(pin), *(_fitted(state.switches[joint].get(name)) for name in SWITCHES)]
        for joint, pin in state.protect.items()
    ]
    print_table(["joint", "Protect", *SWITCHES], rows, text_columns=2 + len(SWITCHES))


def _fitted(switch: "SwitchState | None") -> str:
    return switch_text(switch) if switch else "none"


def _in_ms(late: "LatenessReport") -> str:
    return " ".join(f"{us / 1000:.2f}" for us in (late.late_us_p50, late.late_us_p99, late.late_us_max))
