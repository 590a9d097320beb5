"""Errors of a link: its real DH parameters minus those of the nominal model, by which the machine is planned."""

from dataclasses import dataclass, fields
from typing import Annotated, Final

from steptwin.host.common.errors import InputError
from steptwin.host.common.file_models import FileTable
from steptwin.host.common.file_values import Within

LENGTH_MAX_MM: Final = 50.0
"""Largest error of a length; one that is larger belongs into the dimensions."""

ANGLE_MAX_DEG: Final = 10.0
"""Largest error of an angle; one that is larger belongs into the home position."""

_LENGTH: Final = Within(-LENGTH_MAX_MM, LENGTH_MAX_MM, "mm")
_ANGLE: Final = Within(-ANGLE_MAX_DEG, ANGLE_MAX_DEG, "deg")
_Length = Annotated[float, _LENGTH]
_Angle = Annotated[float, _ANGLE]


@dataclass(frozen=True, slots=True)
class LinkErrors(FileTable):
    """Real minus nominal parameters of one row of the DH table: lengths in mm, angles in degrees.

    Raises:
        InputError: an error is larger than LENGTH_MAX_MM or ANGLE_MAX_DEG.
    """

    a_mm: _Length = 0.0
    alpha_deg: _Angle = 0.0
    d_mm: _Length = 0.0
    theta_deg: _Angle = 0.0


QUANTITIES: Final = tuple(field.name for field in fields(LinkErrors))
"""The parameters of a link, in the order of all arrays of errors."""


def unit_of(quantity: str) -> str:
    """Return the unit of a parameter, mm or deg."""
    return quantity.rpartition("_")[2]


def check_size(name: str, error: float) -> None:
    """Raise InputError unless the error of a parameter is within its limit; the unit ends the parameter's name."""
    if text := (_LENGTH if unit_of(name) == "mm" else _ANGLE).complaint(error):
        raise InputError(f"{name}: {text}")
