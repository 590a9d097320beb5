"""Render what pages say of the emulated machine and its runs.

docs/faults.md has an example, all faults and their documented reactions, docs/robot-files.md the options on the
command line and in Python, docs/run-folder.md the figures of reports.
"""

import re
from dataclasses import Field, fields
from math import isinf
from typing import Any, Final

from docs.generate.commands import DOCS, GeneratedPage, session
from docs.generate.markdown import table
from docs.generate.paper_pages import PAPERS
from steptwin.features.faults.fault import Key
from steptwin.features.faults.judge import longest_ramp_ms
from steptwin.features.faults.kinds import DOCUMENTED
from steptwin.features.faults.reaction import MotionEffect, Reaction
from steptwin.features.faults.requests import REQUESTS, description, keys_of, sentence
from steptwin.host.common.choices import STATE
from steptwin.host.common.features import giving
from steptwin.host.robots import load_robot
from steptwin.host.twin.machine.machine_options import SPELLING, MachineOptions
from steptwin.host.verify.figures import axis_figures

EXAMPLE: Final = DOCS / "examples" / "faults" / "carry.toml"


PLAIN: Final = {"number", "whole number", "name of a joint"}
"""Descriptions of keys that their names give as well."""


def _requests() -> str:
    rows = []
    for do in REQUESTS:
        if do != STATE:
            keys = [
                "; ".join(_written(key) for key in keys_of(do).values() if key.optional == optional)
                for optional in (False, True)
            ]
            rows.append([f"`{do}`", *(each or "-" for each in keys), sentence(do)])
    return table(["`do`", "keys", "may also have", ""], rows, text_columns=4)


def _written(key: Key) -> str:
    says = description(key)
    return f"`{key.name}`" if says in PLAIN else f"`{key.name}`: {says}"


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
    if not reaction.stops or reaction.motion is MotionEffect.NOT_BEGUN:
        return "-"
    return "whenever it comes to that" if isinf(reaction.begins_ms) else f"{reaction.begins_ms:g} ms"


def _position(reaction: Reaction) -> str:
    if not reaction.verified:
        return "wrong: the verdict reports it"
    return "known" if reaction.position_known else "unknown, if it moved"


def _ramps() -> str:
    rows = [[name, f"{longest_ramp_ms(load_robot(name)):g} ms"] for name in PAPERS]
    return table(["robot", "longest ramp"], rows)


FAULTS_PAGE: Final = GeneratedPage(
    "faults",
    "the faults in features/faults/kinds/",
    {
        "example": lambda _: f"```toml\n{EXAMPLE.read_text(encoding='utf-8').strip()}\n```",
        "run": lambda arguments: session(f"run {arguments}"),
        "requests": lambda _: _requests(),
        "reactions": lambda _: _reactions(),
        "ramps": lambda _: _ramps(),
    },
)


def _figures() -> str:
    rows = [
        [f"`{key}`", figure.says, figure.unit or "-", "yes" if figure.exact else "-"]
        for key, figure in axis_figures().items()
    ]
    return table(["key", "figure", "unit", "by the edges alone"], rows, text_columns=4)


RUN_FOLDER_PAGE: Final = GeneratedPage(
    "run-folder", "the figures in host/verify/figures.py", {"figures": lambda _: _figures()}
)


def machine_options() -> str:
    """Return the table of the emulated machine's options, on the command line and in Python."""
    own = [_row(field, f"{field.name}={{}}") for field in fields(MachineOptions) if SPELLING in field.metadata]
    classes = [options() for _, options in giving("machine_options")]
    of_features = [
        _row(field, f"{made.__name__}({field.name}={{}})")
        for made in classes
        for field in fields(made)
        if SPELLING in field.metadata
    ]
    return table(["`--machine`", "in Python", ""], own + of_features, text_columns=3)


def _row(field: Field[Any], in_python: str) -> list[str]:
    spelling = field.metadata[SPELLING]
    says = re.sub(r"\bdocs/([\w-]+\.md)", r"[\1](\1)", spelling.says)
    option = f"`{spelling.key}={spelling.value}`" if spelling.value else f"`{spelling.key}`"
    return [option, f"`{in_python.format(spelling.example)}`", says]
