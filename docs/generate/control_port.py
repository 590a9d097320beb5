"""Render docs/control-port.md: the words of `steptwin inject`, and the keys of requests."""

from typing import Final

from docs.generate.commands import DOCS, filled
from steptwin.host.common.requests import FORMS, INJECTED
from steptwin.host.studies.papers.paper_page import table

CONTROL_PORT_PAGE: Final = DOCS / "control-port.md"

_NOTICE: Final = "<!-- Made by `make docs` from docs/control-port/ and host/common/requests.py: change those. -->"


def render_control_port() -> str:
    """Return the whole page; it ends with a newline."""
    page = filled(DOCS / "control-port" / "control-port.md", {"words": lambda _: _words(), "keys": lambda _: _keys()})
    return f"{_NOTICE}\n\n{page}\n"


def _words() -> str:
    rows = [[f"`{do} {FORMS[do].usage}`".replace(" `", "`"), FORMS[do].does] for do in INJECTED]
    return table(["`inject ROBOT ...`", ""], rows, text_columns=2)


def _keys() -> str:
    rows = []
    for do, form in FORMS.items():
        keys = [
            "; ".join(f"`{key}`: {value.says}" for key, value in each.items()) or "-"
            for each in (form.required, form.optional)
        ]
        rows.append([f"`{do}`", *keys])
    return table(["`do`", "other keys", "may also have"], rows, text_columns=3)
