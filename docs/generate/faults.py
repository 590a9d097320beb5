"""Render docs/faults.md: an example and its run, what faults there are, and the documented reactions."""

from math import isinf
from typing import Final

from docs.generate.commands import DOCS, filled, session
from docs.generate.tables import ROBOTS
from steptwin.host.common.control import Do
from steptwin.host.common.requests import FORMS
from steptwin.host.faults.judge import longest_ramp_ms
from steptwin.host.faults.reaction import Motion, Reaction
from steptwin.host.faults.reactions import DOCUMENTED
from steptwin.host.robots import load_robot
from steptwin.host.studies.papers.paper_page import table

FAULTS_PAGE: Final = DOCS / "faults.md"
EXAMPLE: Final = DOCS / "examples" / "faults" / "carry.toml"

_NOTICE: Final = "<!-- Made by `make docs` from docs/faults/faults.md and the table of reactions: change those. -->"


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
    for do, form in FORMS.items():
        if do is not Do.STATE:
            required, optional = (
                ", ".join(f"`{key}`" for key in keys) or "-" for keys in (form.required, form.optional)
            )
            rows.append([f"`{do}`", required, optional, form.does])
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
