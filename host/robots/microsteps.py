"""Compare the microsteps per full step of one axis in the three places that must agree."""

from typing import NamedTuple


class Microsteps(NamedTuple):
    """Microsteps per full step of an axis; as text, a sentence that names them.

    Attributes:
        joint: name of the axis' joint.
        driver: those that the driver makes, by its pins M1 and M2 or by its module's switches.
        board: those that the board counts with (2000h:01).
        filed: those of the robot's file.
    """

    joint: str
    driver: int
    board: int
    filed: int

    @property
    def agree(self) -> bool:
        """True if all three are the same."""
        return self.driver == self.board == self.filed

    @property
    def right(self) -> bool:
        """True if positions on the bus are those of the motor: the driver makes the steps that the board counts."""
        return self.driver == self.board

    def __str__(self) -> str:
        """Say what is set where, and how far motions go if they go wrong."""
        if self.agree:
            return f"{self.joint}: {self.driver} microsteps"
        filed = f"the robot's file says {self.filed}"
        if self.right:
            return f"{self.joint}: driver and board make {self.driver} microsteps, {filed}"
        return (
            f"{self.joint}: the driver makes {self.driver} microsteps, the board counts with {self.board}, {filed}:"
            f" it moves {self.board / self.driver:g} times as far as the board says"
        )
