"""The errors of a run whose motion never began although its scenario had: they tell what has become of its faults."""

from steptwin.host.common.errors import BusError, DeviceFaultError, StepTwinError
from steptwin.host.twin.scenarios.report import ScenarioReport


class NotBegunError(StepTwinError):
    """No motion began.

    Attributes:
        scenario: what has become of the faults until then; its last reason says why no motion began.
    """

    scenario: ScenarioReport


class SilentStartError(NotBegunError, BusError):
    """Nobody answered the host."""


class FaultyStartError(NotBegunError, DeviceFaultError):
    """A drive was in fault, or refused what the host wanted."""


def not_begun(error: BusError | DeviceFaultError, scenario: ScenarioReport) -> NotBegunError:
    """Return the error for a motion that has not begun because of another error."""
    kind = SilentStartError if isinstance(error, BusError) else FaultyStartError
    made = kind(str(error)).plainly(error.plain)
    made.scenario = scenario
    return made
