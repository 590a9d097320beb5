"""`steptwin new my-arm.toml`: write the file of a robot of your own."""

import json
import re
from collections.abc import Sequence
from dataclasses import MISSING, dataclass
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Any, Protocol

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import AnswerOptions, Replace, keep_files
from steptwin.host.cli.asking import ask, on_terminal
from steptwin.host.cli.options import argument, given_options, of_features, option
from steptwin.host.cli.output import print_table, say
from steptwin.host.common.bad_input import prefixed, unknown
from steptwin.host.common.choices import name_value_pairs
from steptwin.host.common.errors import InputError
from steptwin.host.common.whole_file import write_whole

if TYPE_CHECKING:
    from steptwin.host.robots.new_file import NewRobot
    from steptwin.host.robots.robot import Dimension


class RobotSource(Protocol):
    """A feature's options of `steptwin new` for robots from other files."""

    def robot(self, name: str, kind: str | None, given: dict[str, str], original: str | None) -> "NewRobot | None":
        """Return the robot of the named file, or of --from (`original`); None without one.

        Raises:
            InputError: the options exclude each other, or the file is invalid.
        """
        ...


@dataclass(frozen=True, slots=True)
class SourceOptions:
    """Sources of robots by features."""

    sources: Sequence[RobotSource] = of_features("new_options")

    def robot(self, name: str, kind: str | None, given: dict[str, str], original: str | None) -> "NewRobot | None":
        """Return the robot of the named file; None without one."""
        made = [source.robot(name, kind, given, original) for source in self.sources]
        return next((robot for robot in made if robot is not None), None)


def _other_kinds() -> list[str]:
    """Return the kinds of features with their dimensions, a line each."""
    from steptwin.host.robots.kinematics.base import dimensions
    from steptwin.host.robots.kinematics.kinds import CORE_KINDS, kinds

    return [
        f"{name}: {' '.join(dimensions(kind.geometry))}" for name, kind in kinds().items() if name not in CORE_KINDS
    ]


@command(
    "my-arm.toml --kind scara --set l1_mm=200",
    "my-arm.toml --from ar4-mk3",
    more=_other_kinds,
)
def new(
    answer: AnswerOptions,
    others: SourceOptions,
    file: str = argument("FILE", "File to write; the robot gets its name, without .toml.", MISSING),
    original: str | None = option(
        "ROBOT|FILE",
        "Copy the file of a robot that StepTwin brings, under the new name, or make it of a file of another kind.",
        "--from",
    ),
    kind: str | None = option("KIND", "Kind of the mechanism; asked for on a terminal."),
    settings: list[str] | None = option("KEY=VALUE", "A dimension or a joint's value; may be repeated.", "--set"),
    replace: Replace = False,
) -> None:
    """Write the file of a robot of your own, with comments: kind, dimensions, ranges and transmissions.

    Without --kind, on a terminal, it asks for all of them. With it, what --set does not say is as usual for the kind.
    Speeds, switches and homing follow; change what you like and let `steptwin check` look at the file.

    With --from it is the file of a robot that is there, such as ar4-mk3, with the new robot's name, to change.

    All kinds: driver_profile, the drivers, such as a4988 (docs/driver.md).

    A joint's values: JOINT.lower, JOINT.upper, JOINT.travel_per_turn (mm) or JOINT.ratio, JOINT.microsteps (8; 1/8 is
    taken for 8), JOINT.home, JOINT.motor (its model, such as 17HS19-2004S1), JOINT.mass_kg (what it moves).

    A motor, a mass or supply_v adds all keys that `run --motors` needs. Assumed values are marked ASSUMED.

    Kinds and their dimensions, drawn in docs/robot-files.md:

    scara: l1_mm l2_mm lift lift_positive tool_rotation tool heading_deg base_mm offset_mm drop_mm tool_mm

    cartesian: axes belts (each or corexy)

    axes: no dimensions (joints, 1 to 8)

    chain: notation chain task held base tool (joints, 1 to 6; JOINT.theta_deg, JOINT.alpha_deg, JOINT.d_mm, JOINT.a_mm)
    """
    from steptwin.host.robots import SUFFIX
    from steptwin.host.robots.kinematics.kinds import kinds
    from steptwin.host.robots.new_file import new_motors, robot_text, with_settings

    path = Path(file)
    if path.suffix != SUFFIX:
        named = quote(f"{path.stem or 'robot'}{SUFFIX}")
        raise InputError(f"{file}: does not end in {SUFFIX}: a robot file does, such as {named}")
    keep_files([path], replace=replace)
    given = name_value_pairs(settings or [])
    if made := others.robot(path.stem, kind, given, original):
        write_whole(path, made.text)
        document = {"kind": made.kind, "dimensions": made.geometry, "joints": made.joints, "notes": made.notes}
        _tell(answer, file, document)
        return
    if original is not None:
        foreign = [*(["--kind"] if kind else []), *(["--set"] if given else []), *given_options(others)]
        _copy(answer, path, original, foreign)
        return
    if kind is None:
        kind = _asked_kind()
        given = _asked(path.stem, kind, given)
    elif kind not in kinds():
        raise unknown("--kind", kind, kinds())
    with prefixed("--set "):
        geometry, joints = with_settings(kind, given)
    write_whole(path, robot_text(path.stem, kind, geometry, joints))
    notes = [
        f"{key}: {text} of a full step is written as microsteps = {text[2:]}"
        for key, text in given.items()
        if key.endswith(".microsteps") and text.startswith("1/")
    ]
    motors = new_motors(geometry, joints)
    notes += [f"fill in: {each}" for each in motors.assumptions({joint.name: joint.unit for joint in joints})]
    document = {"kind": kind, "dimensions": geometry, "joints": [joint.name for joint in joints]}
    _tell(answer, file, document | ({"notes": notes} if notes else {}))


def _copy(answer: AnswerOptions, path: Path, original: str, foreign: list[str]) -> None:
    """Write a copy of one of StepTwin's robots under another name; raise InputError for an unknown robot."""
    from steptwin.host.robots import brought_text, read_robot

    if foreign:
        raise InputError(f"--from {original}: is a whole robot: leave {foreign[0]} out and change the file")
    with prefixed("--from: "):
        text = brought_text(original)
    own = f"name = {json.dumps(path.stem, ensure_ascii=False)}"
    text = re.sub(r"^name = .*$", lambda _: own, text, count=1, flags=re.MULTILINE)
    robot = read_robot(text)
    write_whole(path, text)
    _tell(answer, str(path), {"from": original, "kind": robot.kinematics, "joints": list(robot.joint_names)})


def _tell(answer: AnswerOptions, file: str, document: dict[str, Any]) -> None:
    """Print a summary of the written file."""
    answer.tell(
        {"file": file, **document},
        f"{file}: a robot of the kind {document['kind']} with the joints {' '.join(document['joints'])}",
        *document.get("notes", ()),
        f"look at it with: steptwin check {quote(file)}",
    )


def _asked_kind() -> str:
    from steptwin.host.robots.kinematics.kinds import kinds

    if not on_terminal():
        raise InputError(f"--kind is missing: {', '.join(kinds())}")
    print_table(["kind", "what it is"], [[name, kind.summary] for name, kind in kinds().items()], text_columns=2)

    def check(name: str) -> None:
        if name not in kinds():
            raise unknown("kind", name, kinds())

    return ask("kind", next(iter(kinds())), check)


def _asked(name: str, kind: str, given: dict[str, str]) -> dict[str, str]:
    """Ask for missing dimensions and joint values until they make a robot."""
    from steptwin.host.robots.new_file import robot_text, with_settings

    usual: dict[str, str] = {}
    while True:
        answers = _asked_once(kind, given, usual)
        try:
            robot_text(name, kind, *with_settings(kind, answers))
        except InputError as error:
            say(*error.messages, "once more, each with your last answer:")
            usual = answers
        else:
            return answers


def _asked_once(kind: str, given: dict[str, str], usual: dict[str, str]) -> dict[str, str]:
    from steptwin.host.robots.new_file import questions_of, with_settings

    def asked(key: str, what: str, value: "Dimension") -> None:
        def check(text: str) -> None:
            with_settings(kind, answers | {key: text})

        if key not in answers:
            answers[key] = ask(f"{key}, {what}", usual.get(key, _text(value)), check)

    answers = {key: text for key, text in given.items() if "." not in key or key in questions_of(kind, given)}
    while missing := [key for key in questions_of(kind, answers) if key not in answers]:
        what, value = questions_of(kind, answers)[missing[0]]
        asked(missing[0], what, value)
    answers |= given
    for joint in with_settings(kind, answers)[1]:
        for key, (what, value) in joint.questions.items():
            asked(f"{joint.name}.{key}", f"{joint.what}: {what}", value)
    return answers


def _text(value: "Dimension") -> str:
    return str(value).lower() if isinstance(value, bool) else f"{value:g}" if isinstance(value, float) else str(value)
