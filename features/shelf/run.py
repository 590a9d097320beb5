"""Options of `steptwin run` for a shelf: an inventory file, and the box's name."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from steptwin.features.shelf import shelf_of
from steptwin.features.shelf.options import ShelfOptions
from steptwin.host.cli.options import option
from steptwin.host.cli.run.hooks import Prepared, RunHook
from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError

if TYPE_CHECKING:
    from steptwin.host.robots.robot import Robot


@dataclass(frozen=True, slots=True, kw_only=True)
class ShelfRun(RunHook):
    """Boxes in a run at a shelf, from the job's options or from an inventory file."""

    inventory: str | None = option(
        "FILE",
        "Inventory of the shelf: gives a box a free slot or finds it, and is written after a verified run. The box's"
        " name follows the job.",
    )

    def words_taken(self, robot: "Robot") -> int:
        """Return the number of words allowed after the job: the box's name."""
        shelf = shelf_of(robot)
        return 1 if shelf is not None and shelf.slots else 0

    def prepare(self, robot: "Robot", job: str, options: Mapping[str, str], words: Sequence[str]) -> Prepared:
        """Choose slot and box; raise InputError, with the inventory's file, if that is impossible."""
        from steptwin.host.planning.jobs import job_names

        box = words[0] if words else None
        if self.inventory is None:
            if box is not None:
                raise InputError(f"box {box!r}: boxes have names in an inventory: --inventory FILE")
            return Prepared(options)
        from steptwin.features.shelf.inventory import assign, read_inventory

        if job not in job_names(robot):
            raise InputError(f"--inventory {self.inventory}: is for jobs that carry boxes, not for {job}")
        inventory = read_inventory(self.inventory, robot)
        with prefixed(f"{self.inventory}: "):
            assigned = assign(robot, job, options, inventory, box)
        return Prepared(assigned.options, ShelfOptions(errand=assigned.errand), (inventory, assigned.errand))

    def finish(self, robot: "Robot", kept: Any) -> str:
        """Write the inventory after a verified run; return a line about it, or an empty text."""
        shelf = shelf_of(robot)
        if kept is None or shelf is None or self.inventory is None:
            return ""
        from steptwin.features.shelf.inventory import write_inventory, written_after

        inventory, errand = kept
        after = written_after(inventory, errand, shelf)
        write_inventory(self.inventory, inventory, after, robot)
        held = ", ".join(f"{slot} {box}" for slot, box in after.boxes.items())
        return f"{self.inventory}: {held or 'the shelf is empty'}"
