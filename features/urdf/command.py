"""`steptwin urdf ROBOT`: export a robot for ROS tools; and the options of `steptwin new FILE --urdf FILE`."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import Replace, RobotFile, RobotName, RobotOptions, keep_files
from steptwin.host.cli.options import given_options, option, switch
from steptwin.host.cli.output import print_text, say
from steptwin.host.common.errors import InputError
from steptwin.host.common.whole_file import write_whole

if TYPE_CHECKING:
    from steptwin.host.robots.new_file import NewRobot


@dataclass(frozen=True, slots=True, kw_only=True)
class UrdfOptions:
    """Options for a robot from a URDF."""

    urdf: str | None = option("FILE", "URDF with the joints of an arm: makes a chain of them.")
    tip: str | None = option("LINK", "With --urdf: the tool's link; by default the only leaf that needs no mimic.")
    base: str | None = option("LINK", "With --urdf: the link that stands; by default the root.")
    snap: bool = switch("With --urdf: make angles exact within 2e-5 rad of multiples of 15 deg.")

    def robot(self, name: str, kind: str | None, given: dict[str, str], original: str | None) -> "NewRobot | None":
        """Return the robot of the URDF; None without one. Raises InputError for options that exclude each other."""
        from steptwin.features.urdf.urdf_robot import KIND, UrdfSource

        if self.urdf is None:
            if alone := next(iter(given_options(self)), None):
                raise InputError(f"{alone}: is for a robot made of a URDF: give --urdf FILE")
            return None
        if original is not None:
            raise InputError(f"--from {original}: beside --urdf {self.urdf}: give only one of them")
        if kind not in (None, KIND):
            raise InputError(f"--kind {kind}: a URDF makes a {KIND}: leave --kind out")
        return UrdfSource(self.urdf, self.tip, self.base, self.snap).robot(name, given)


@command("my-arm.toml > my-arm.urdf", "my-arm.toml --out my-arm.urdf")
def urdf(
    robot: RobotName = None,
    robot_file: RobotFile = None,
    out: str | None = option("FILE", "File to write instead of printing it."),
    replace: Replace = False,
) -> None:
    """Print a robot of the kind chain as a URDF: frames, axes, limits and speeds of its joints, in m and rad.

    The last link, tool0, is the tool. A URDF has no place for transmissions, microsteps, drivers, switches and the
    base's place in the station: they are left out.
    """
    from steptwin.features.urdf.urdf_export import urdf_of

    text = urdf_of(RobotOptions(robot_file=robot_file).robot(robot))
    if out is None:
        print_text(text)
        return
    keep_files([Path(out)], replace=replace)
    write_whole(Path(out), text)
    say(f"{out}: the robot from base_link to tool0")
