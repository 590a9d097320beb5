"""How an emulated machine differs from its robot's file, and what happens to it on purpose."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, TypedDict

from steptwin.host.faults.scenario import Scenario
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.machine.axes_per_board import check_axes_per_board
from steptwin.host.twin.machine.boards import check_crystals


class MachineKeywords(TypedDict, total=False):
    """The fields of `MachineOptions`, as keyword arguments of the functions that users call."""

    driver_profile: str | None
    dip_microsteps: Mapping[str, int] | None
    stock: Mapping[str, str] | None
    locked_drawers: Collection[str]
    scenario: Scenario | None
    motors: bool
    axes_per_board: Sequence[int] | None
    crystal_ppm: int | Sequence[int]


@dataclass(frozen=True, slots=True, kw_only=True)
class MachineOptions:
    """An emulated machine beside its robot's file. Neither the plan nor the host is told of any of it.

    Attributes:
        driver_profile: name of the drivers that the boards have instead of those in the robot's file.
        dip_microsteps: microsteps to which the switches of the drivers' modules are set instead of the file's, by
            joint.
        stock: the boxes in the robot's shelf, by slot or spot; None: a box at each spot where boxes are taken.
        locked_drawers: slots of the shelf whose drawers are locked.
        scenario: faults that happen to it (docs/faults.md).
        motors: True if the robot's motors turn with the boards, so that its switches follow the rotors.
        axes_per_board: number of axes on each of several boards, in the order of the joints; None: one board has all.
        crystal_ppm: how fast the boards' crystals are, in parts per million from -1000 to 1000, with which no motors
            turn: one number for all boards, or each one's; empty: all are exact.
    """

    driver_profile: str | None = None
    dip_microsteps: Mapping[str, int] | None = None
    stock: Mapping[str, str] | None = None
    locked_drawers: Collection[str] = ()
    scenario: Scenario | None = None
    motors: bool = False
    axes_per_board: Sequence[int] | None = None
    crystal_ppm: int | Sequence[int] = 0

    @property
    def crystals_ppm(self) -> tuple[int, ...]:
        """How fast each board's crystal is, in parts per million; empty: all are exact."""
        if isinstance(self.crystal_ppm, int):
            return (self.crystal_ppm,) * len(self.axes_per_board or (1,))
        return tuple(self.crystal_ppm)

    def boards_of(self, robot: Robot) -> tuple[int, ...]:
        """Return the number of axes on each board.

        Raises:
            InputError: the boards have not as many axes as the robot, or a crystal is too far off or motors turn with
                it.
        """
        per_board = (len(robot.joints),) if self.axes_per_board is None else tuple(self.axes_per_board)
        check_axes_per_board(per_board, len(robot.joints))
        check_crystals(self.crystals_ppm, len(per_board), motors=self.motors)
        return per_board


AS_FILED: Final = MachineOptions()
"""A machine as its robot's file has it."""
