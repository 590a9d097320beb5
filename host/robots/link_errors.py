"""Errors of a link: its real DH parameters minus those of the nominal model, by which the machine is planned."""

from dataclasses import dataclass, fields
from functools import partial
from typing import Final

from steptwin.host.common.bad_input import nearest_within, outside
from steptwin.host.common.errors import InputError
from steptwin.host.common.findings import check_all

LENGTH_MAX_MM: Final = 50.0
"""Largest error of a length; one that is larger belongs into the dimensions."""

ANGLE_MAX_DEG: Final = 10.0
"""Largest error of an angle; one that is larger belongs into the home position."""


@dataclass(frozen=True, slots=True)
class LinkErrors:
    """Real minus nominal parameters of one row of the DH table: lengths in mm, angles in degrees.

    Raises:
        InputError: an error is larger than LENGTH_MAX_MM or ANGLE_MAX_DEG.
    """

    a_mm: float = 0.0
    alpha_deg: float = 0.0
    d_mm: float = 0.0
    theta_deg: float = 0.0

    def __post_init__(self) -> None:
        check_all(*(partial(check_size, quantity, getattr(self, quantity)) for quantity in QUANTITIES))


QUANTITIES: Final = tuple(field.name for field in fields(LinkErrors))
"""The parameters of a link, in the order of all arrays of errors."""


def unit_of(quantity: str) -> str:
    """Return the unit of a parameter, mm or deg."""
    return quantity.rpartition("_")[2]


def check_size(name: str, error: float) -> None:
    """Raise InputError unless the error of a parameter is within its limit; the unit ends the parameter's name."""
    unit = unit_of(name)
    limit = LENGTH_MAX_MM if unit == "mm" else ANGLE_MAX_DEG
    if not abs(error) <= limit:
        raise InputError(f"{name}: {outside(error, -limit, limit, unit)}{nearest_within(error, -limit, limit, unit)}")
