"""Render docs/faults.md: an example and its run, what faults there are, and the documented reactions."""

from math import isinf
from typing import Final

from docs.generate.commands import session
from docs.generate.pieces import DOCS, filled
from docs.generate.runs import ROBOTS
from steptwin.host.common.control import Do
from steptwin.host.papers.markdown import table
from steptwin.host.robots import load_robot
from steptwin.host.twin.control.operations import keys_of
from steptwin.host.twin.scenarios.reactions import DOCUMENTED, Motion, Reaction
from steptwin.host.twin.scenarios.report import longest_ramp_ms

FAULTS_PAGE: Final = DOCS / "faults.md"
EXAMPLE: Final = DOCS / "examples" / "faults" / "carry.toml"

_NOTICE: Final = "<!-- Made by `make docs` from docs/faults/faults.md and the table of reactions: change those. -->"
_DOES: Final = {
    Do.ESTOP: "the emergency stop is pressed, or pulled out",
    Do.SUPPLY: "the motor supply has this voltage",
    Do.TEMPERATURE: "the board has this temperature",
    Do.PROTECT: "the Protect pin of a driver is held low, as by a chip that is too hot",
    Do.INPUT: "a sensor of the robot's file is active, or not",
    Do.SWITCH: "a switch `-`, `+` or `home` sticks `closed` or `open`, or is `free`",
    Do.SWITCH_WIRE: "a switch's wire is `whole`, or broken at a contact that is `normally-open` or `normally-closed`",
    Do.BOUNCE: "a switch bounces so often with each change, within 5 ms",
    Do.MODE: "a driver is set to another microstep mode, or as it was",
    Do.OSC: "the capacitor at a driver chip's OSC pin has another value",
    Do.SLIP: "a motor falls out of step by whole electrical cycles: a multiple of 4 full steps",
    Do.PAYLOAD: "the payload has another mass; only with motors that turn with the board (`run --motors=loop`)",
    Do.WIRE: "the wire `step`, `dir` or `enable` to a driver is `broken`, shorted `low` or `high`, `noisy` or `whole`",
    Do.BROWN_OUT: "the logic of a board, or of all boards, is without supply for a time, or until `power-up`",
    Do.WATCHDOG: "the watchdog resets a board's processor, or that of all boards, while the drivers keep their supply",
    Do.POWER_UP: "a board that is down starts again",
    Do.STRANGER: "a foreign station, such as a second master, sends a frame",
    Do.BABBLE: "the same station sends a frame again and again",
    Do.LOSS: "frames are acknowledged and do not arrive",
    Do.CORRUPTION: "frames are disturbed: CAN sends them again",
    Do.DUPLICATE: "frames come twice, as after an error in their last bit",
    Do.DELAY: "the sender of a frame waits before it sends it",
    Do.BUS_OFF: "the board of a joint, or without `joint` the host, goes into bus-off",
    Do.BUS_OK: "all faults of the bus end",
    Do.HOST: "something goes wrong with the host: see below",
}


def render_faults() -> str:
    """Return the whole page; it ends with a newline."""
    page = filled(
        DOCS / "faults" / "faults.md",
        {
            "example": lambda _: f"```toml\n{EXAMPLE.read_text(encoding='utf-8').strip()}\n```",
            "run": lambda arguments: session(f"run {arguments}"),
            "requests": lambda _: _requests(),
            "reactions": lambda _: _reactions(),
            "ramps": lambda _: _ramps(),
        },
    )
    return f"{_NOTICE}\n\n{page}\n"


def _requests() -> str:
    rows = []
    for do in Do:
        if do is not Do.STATE:
            required, optional = (", ".join(f"`{key}`" for key in keys) or "-" for keys in keys_of(do))
            rows.append([f"`{do}`", required, optional, _DOES[do]])
    return table(["`do`", "keys", "may also have", ""], rows, text_columns=4)


def _reactions() -> str:
    rows = []
    for row in DOCUMENTED:
        reaction = row.reaction
        codes = " or ".join(f"0x{code:04X}" for code in reaction.codes) or "none"
        state = reaction.state.name.replace("_", " ") if reaction.state else "as before"
        motion = reaction.motion.value if reaction.certain else f"may: {reaction.motion.value}"
        rows.append([row.what, motion, codes, state, _begins(reaction), _position(reaction), row.why or "-"])
    return table(["fault", "the motion", "EMCY", "drive", "begins", "position", "remark"], rows, text_columns=7)


def _begins(reaction: Reaction) -> str:
    if not reaction.stops or reaction.motion is Motion.NOT_BEGUN:
        return "-"
    return "whenever it comes to that" if isinf(reaction.begins_ms) else f"{reaction.begins_ms:g} ms"


def _position(reaction: Reaction) -> str:
    if not reaction.verified:
        return "wrong: the verdict tells it"
    return "known" if reaction.position_known else "unknown, if it moved"


def _ramps() -> str:
    rows = [[name, f"{longest_ramp_ms(load_robot(name)):g} ms"] for name in ROBOTS]
    return table(["robot", "longest ramp"], rows)
