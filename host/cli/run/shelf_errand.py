"""What a run does with the boxes of a robot's shelf: by its job's options, or as an inventory file assigns it."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from steptwin.host.cli.arguments import AnswerOptions
from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError

if TYPE_CHECKING:
    from steptwin.host.planning.errand import Errand
    from steptwin.host.planning.inventory import Inventory
    from steptwin.host.robots.robot import Robot


@dataclass(frozen=True, slots=True)
class ShelfErrand:
    """An errand, the job's options with its slot, and the inventory file that it changes.

    Attributes:
        options: the job's options.
        errand: what is done with the boxes; None for a motion that carries none.
        path: the inventory file; empty without one.
        inventory: what the file holds; None without one.
    """

    options: Mapping[str, str]
    errand: "Errand | None" = None
    path: str = ""
    inventory: "Inventory | None" = None

    def keep(self, answer: AnswerOptions, robot: "Robot") -> None:
        """Write the inventory as it is after the run; raises as `write_inventory`."""
        if self.inventory is None or self.errand is None or robot.shelf is None:
            return
        from steptwin.host.planning.inventory import write_inventory, written_after

        after = written_after(self.inventory, self.errand, robot.shelf)
        write_inventory(self.path, self.inventory, after, robot)
        held = ", ".join(f"{slot} {box}" for slot, box in after.boxes.items())
        answer.add(f"{self.path}: {held or 'the shelf is empty'}")


def choose_errand(
    robot: "Robot", job: str, options: Mapping[str, str], inventory_path: str | None, box: str | None
) -> ShelfErrand:
    """Return the errand of a job; raise InputError, with the inventory's file, if it cannot be done."""
    from steptwin.host.planning.errand import Errand
    from steptwin.host.planning.jobs import job_carries, job_names

    if inventory_path is None:
        if box is not None:
            raise InputError(f"box {box!r}: boxes have names in an inventory: --inventory FILE")
        carries = job_carries(robot, job, options) if job in job_names(robot) else ()
        return ShelfErrand(options, Errand.alone(carries) if carries else None)
    from steptwin.host.planning.inventory import assign, read_inventory

    if job not in job_names(robot):
        raise InputError(f"--inventory {inventory_path}: is for jobs that carry boxes, not for {job}")
    inventory = read_inventory(inventory_path, robot)
    with prefixed(f"{inventory_path}: "):
        assigned = assign(robot, job, options, inventory, box)
    return ShelfErrand(assigned.options, assigned.errand, inventory_path, inventory)
