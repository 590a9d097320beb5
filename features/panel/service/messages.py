"""Messages of errors for pages: without bus details, and with the page's controls in place of parameters."""

import re
from typing import Final

from steptwin.host.common.errors import InputError, StepTwinError


class RefusedError(InputError):
    """The service refuses a page's request, and nothing has changed; the message gives the reason in one line."""


AS_SLOW_AS_NEEDED: Final = "as slow as it must be"  # the speed of a run that passes regardless of limits
MOVE_TO_START: Final = "first move to its start"  # the switch that lets a run begin anywhere
DECLARE_POSITION: Final = "Declare as position"  # the button that declares the joints' position

_CHOICES: Final = tuple(
    (re.compile(parameter), choice)
    for parameter, choice in (
        (r" \(stretch=[^)]*\)", f': choose the speed "{AS_SLOW_AS_NEEDED}"'),
        (r"\bstretch=\S+ passes", f'choose the speed "{AS_SLOW_AS_NEEDED}"'),
        (r"\bno stretch up to (\S+) makes it pass", r"not even \1 times slower passes"),
        (r" \((?:elbow|interpolate|ramps_s)=[^)]*\)", ""),  # chosen by the file's author
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
"""Parameters of the library in messages, and the page's replacement; the first match is taken."""


def operator_message(error: StepTwinError) -> str:
    """Return an error's message for pages: cause and remedy, in one line."""
    text = error.plain
    for parameter, choice in _CHOICES:
        text = parameter.sub(choice, text)
    return text
