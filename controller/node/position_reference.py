"""Track whether an axis knows its position, and how far its rotor has fallen behind the step counter."""

from steptwin.controller.motion.board_motion import BoardMotion
from steptwin.protocol import od
from steptwin.protocol.dictionary import ObjectDictionary
from steptwin.protocol.objects import UNITS_PER_FULL_STEP


class PositionReference:
    """The position reference of one axis: set by homing, lost when the driver is cut off in motion.

    The steps that the driver has lost stand in object 2F00h, which only the emulated board supplies. A real board
    without encoder counts every step as made, and its following error is then the rounding to steps.
    """

    def __init__(self, axis: int, motion: BoardMotion, dictionary: ObjectDictionary) -> None:
        self._axis = axis
        self._motion = motion
        self._lost_steps = dictionary.cell(od.LOST_STEPS)
        self._lost_before_steps = 0
        """Steps lost before the reference was set last: they do not count."""
        self.known = False
        """True from a homing on, until the axis may have moved without counting."""
        dictionary.bind(self)

    def set(self) -> None:
        """Note that homing has set the position: the rotor is where the counter says."""
        self.known = True
        self._lost_before_steps = self._lost_steps.get()

    def lose(self) -> None:
        """Note that the rotor may have moved without the counter."""
        self.known = False

    @property
    def lost_units(self) -> int:
        """Distance by which the rotor has fallen behind the step counter since the reference was set."""
        lost_steps = self._lost_steps.get() - self._lost_before_steps
        return lost_steps * UNITS_PER_FULL_STEP // self._motion.config(self._axis).microsteps

    @property
    def following_error_units(self) -> int:
        """Demanded position less the position that the driver has counted."""
        return self._motion.demand_units(self._axis) - self._motion.counter_units(self._axis) + self.lost_units
