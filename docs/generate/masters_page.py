"""Render docs/masters.md: the table of the checks of a CANopen node."""

from typing import Final

from docs.generate.commands import GeneratedPage
from docs.generate.markdown import table
from steptwin.features.conform.check import Need
from steptwin.features.conform.conformance import ordered

_NEEDS: Final = {Need.NOTHING: "", Need.EDS: "`--eds`", Need.ENABLE: "`--enable`", Need.MOTION: "`--motion`"}


def _checks() -> str:
    rows = [[check.id, check.group, check.clause, check.title, _NEEDS[check.need]] for check in ordered()]
    return table(["check", "group", "clause", "asks", "needs"], rows, text_columns=5)


MASTERS_PAGE: Final = GeneratedPage("masters", "the checks in features/conform/", {"checks": lambda _: _checks()})
