"""Render docs/faults.md, an example, all faults and their documented reactions, and docs/control-port.md."""

from math import isinf
from typing import Final

from docs.generate.commands import DOCS, GeneratedPage, session
from docs.generate.tables import ROBOTS
from steptwin.host.faults.judge import longest_ramp_ms
from steptwin.host.faults.reaction import Motion, Reaction
from steptwin.host.faults.reactions import DOCUMENTED
from steptwin.host.faults.requests import INJECTED, REQUESTS, STATE, does, keys_of, says, usage
from steptwin.host.robots import load_robot
from steptwin.host.studies.papers.paper_page import table

EXAMPLE: Final = DOCS / "examples" / "faults" / "carry.toml"


def _requests() -> str:
    rows = []
    for do in REQUESTS:
        if do != STATE:
            needed, others = (
                ", ".join(f"`{key.name}`" for key in keys_of(do).values() if key.optional == optional) or "-"
                for optional in (False, True)
            )
            rows.append([f"`{do}`", needed, others, does(do)])
    return table(["`do`", "keys", "may also have", ""], rows, text_columns=4)


def _reactions() -> str:
    rows = []
    for row in DOCUMENTED:
        reaction = row.reaction
        codes = " or ".join(f"0x{code:04X}" for code in reaction.codes) or "none"
        state = reaction.state.name.replace("_", " ") if reaction.state else "-" if reaction.stops else "as before"
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


FAULTS_PAGE: Final = GeneratedPage(
    "faults",
    "the table of reactions",
    {
        "example": lambda _: f"```toml\n{EXAMPLE.read_text(encoding='utf-8').strip()}\n```",
        "run": lambda arguments: session(f"run {arguments}"),
        "requests": lambda _: _requests(),
        "reactions": lambda _: _reactions(),
        "ramps": lambda _: _ramps(),
    },
)


def _request_words() -> str:
    rows = [[f"`{do} {usage(do)}`".replace(" `", "`"), does(do)] for do in INJECTED]
    return table(["`inject ROBOT ...`", ""], rows, text_columns=2)


def _keys() -> str:
    rows = []
    for do in REQUESTS:
        keys = [
            "; ".join(f"`{key.name}`: {says(key)}" for key in keys_of(do).values() if key.optional == optional) or "-"
            for optional in (False, True)
        ]
        rows.append([f"`{do}`", *keys])
    return table(["`do`", "other keys", "may also have"], rows, text_columns=3)


CONTROL_PORT_PAGE: Final = GeneratedPage(
    "control-port",
    "the harms in emulator/faults/",
    {"words": lambda _: _request_words(), "keys": lambda _: _keys()},
)
