"""What the options of the jobs are called in a form, where their names on the command line say too little."""

import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Final

from steptwin.host.common.errors import InputError
from steptwin.host.planning.jobs.options import OptionField

TITLES: Final[dict[str, str]] = {
    "approach_mm": "length of the approach",
    "depth_mm": "depth of the grip",
    "elbow": "elbow's side",
    "from": "first point",
    "law": "law of time",
    "mm_per_rad": "growth of the radius",
    "pause_s": "pause at each point",
    "point_s": "time per point",
    "psi_deg": "tool's angle psi",
    "pull_s": "time of a pull",
    "ramp_s": "time to speed up",
    "repetitions": "cycles in one run",
    "rise_mm": "rise per turn",
    "sensors": "shelf's sensors",
    "to": "second point",
    "travel_mm": "length of the pull",
    "x_mm": "centre x",
    "y_mm": "centre y",
    "z_law": "law of the rise",
    "z_mm": "height of the start",
}
"""Title of each option by its name."""


def option_title(field: OptionField) -> str:
    """Return the title of an option; without one of its own it is its name without the unit."""
    if field.name in TITLES:
        return TITLES[field.name]
    unit = "" if field.allowed is None else field.allowed.unit
    return field.name.replace("_", " ").removesuffix(f" {unit}")


@contextmanager
def naming_titles(fields: Iterable[OptionField]) -> Iterator[None]:
    """Let errors of the block name options by the titles that the form shows."""
    titles = {field.name: option_title(field) for field in fields if "_" in field.name}
    try:
        yield
    except InputError as error:
        names = re.compile(rf"\b({'|'.join(titles)})\b")
        plain = names.sub(lambda found: f'"{titles[found[1]]}"', error.plain) if titles else error.plain
        raise InputError(*error.messages).plainly(plain) from error
