"""The settings that a page shows and changes: of the board, and of this desk alone."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Setting:
    """A setting with its present value.

    Attributes:
        key: its name for `WriteSettings`, such as `th2.speed_max`.
        joint: the joint to which it belongs; None for one of the whole machine.
        title: what it is, in plain words.
        unit: unit of value and limits.
        value: the present value.
        lower: least value that is allowed.
        upper: highest value that is allowed.
        stored: True if the board has it, False if only this desk keeps it.
    """

    key: str
    joint: str | None
    title: str
    unit: str
    value: float
    lower: float
    upper: float
    stored: bool
