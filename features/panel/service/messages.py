"""What pages show of an error: nothing of the bus, and what a page offers in place of a program's parameters."""

import re
from typing import Final

from steptwin.host.common.errors import InputError, StepTwinError


class RefusedError(InputError):
    """The service does not do what a page requests, and nothing has changed; the message says why in one line."""


AS_SLOW_AS_NEEDED: Final = "as slow as it must be"  # the speed of a run that passes whatever the limits are
MOVE_TO_START: Final = "first move to its start"  # the switch that lets a run begin anywhere
DECLARE_POSITION: Final = "Declare as position"  # the button that declares where the joints stand

_CHOICES: Final = tuple(
    (re.compile(parameter), choice)
    for parameter, choice in (
        (r" \(stretch=[^)]*\)", f': choose the speed "{AS_SLOW_AS_NEEDED}"'),
        (r"\bstretch=\S+ passes", f'choose the speed "{AS_SLOW_AS_NEEDED}"'),
        (r"\bno stretch up to (\S+) makes it pass", r"not even \1 times slower passes"),
        (r" \((?:elbow|interpolate|ramps_s)=[^)]*\)", ""),  # the file's author chooses these
        (r"\bapproach=True moves it there first", f'switch on "{MOVE_TO_START}"'),
        (r"the robot's file has no homing for it; declare .*", f'it has no switch: use "{DECLARE_POSITION}" in Move'),
        (r"\brepeat=1 passes", "it can be run once"),
        (r"\brepeat=", "repetitions: "),
        (r"\bspeed_percent=", "speed: "),
        (r"\binterpolate=", "between the points: "),
        (r"\bramps_s=", "run-in and run-out in s: "),
        (r"\blaw=", "law of time: "),
        (r"\bstretch=", "times slower: "),
    )
)
"""Parameters of the library in messages, and what a page offers in their place; the first that fits is taken."""


def operator_message(error: StepTwinError) -> str:
    """Return what pages show of an error: what happened and what to do, in one line."""
    text = error.plain
    for parameter, choice in _CHOICES:
        text = parameter.sub(choice, text)
    return text
