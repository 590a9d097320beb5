"""Read a robot's TOML file. Every error begins with the file and the key, as in `joints.th1.microsteps: ...`.

The tables are models (`steptwin.host.common.file_models`): each is judged as far as its values can be read, and what
depends on a wrong or missing value is not judged. So all that is wrong in a file is found at once.
"""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, fields, make_dataclass, replace
from functools import cache, partial
from reprlib import repr as short
from typing import Annotated, Any, Final

from steptwin.host.common.bad_input import apart, at_most, nearest, prefixed, shortened, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.common.features import giving
from steptwin.host.common.file_limits import NAME_CHARS_MAX, PAPER_CHARS_MAX, TITLE_CHARS_MAX
from steptwin.host.common.file_models import FileReading, FileTable, read_model, read_table, table_schema
from steptwin.host.common.file_values import Name, Positive, ReadBy
from steptwin.host.common.findings import Findings, UnreadError, check_all, judged, part_of
from steptwin.host.common.tables import toml_table
from steptwin.host.robots.board_settings import BoardSettings, Input, Output
from steptwin.host.robots.box import Box
from steptwin.host.robots.coupling import Coupling
from steptwin.host.robots.joint import Joint, SecondMotor, Transmission, Unit, with_fewer_steps
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.kinematics.base import check_names, check_unit
from steptwin.host.robots.kinematics.chain import check_links
from steptwin.host.robots.kinematics.dh import DhTable
from steptwin.host.robots.kinematics.kinds import kinds
from steptwin.host.robots.link_errors import LinkErrors
from steptwin.host.robots.motor import Dynamics, JointLink, JointMotor
from steptwin.host.robots.poses.base_frame import BaseFrame
from steptwin.host.robots.robot import Dimension, Robot
from steptwin.host.robots.switches import JointHoming, JointSwitches

_ROUNDING: Final = 1e-9
"""Rounding error allowed beyond the driver's step rate, as a fraction of it: most steps per degree are inexact."""

_Name = Annotated[str, Name(NAME_CHARS_MAX)]


def parse_robot(text: str, source: str) -> Robot:
    """Return the robot that a TOML text describes; raise InputError, with `source` and the key, for a wrong text."""
    with prefixed(f"{source}: "):
        return read_robot(text)


def read_robot(text: str) -> Robot:
    """Return the robot that a text describes; the InputError's messages are all that is wrong, each with its key."""
    table, findings = toml_table(text).values, Findings()
    if "step" in table and not any(key in table for key in ("kinematics", "joints", "board")):
        raise InputError("is a program, not a robot: its robot's name or file stands before it")
    robot: Robot = read_model(robot_model(), table, findings, known=_Mechanism())
    if not findings.messages:
        with findings.collecting():
            make_kinematics(robot)
    with findings.collecting():
        _check_speeds(robot)
    findings.raise_first()
    return replace(robot, toml=text)


# --- the mechanism, which tells the names of the joints


@dataclass(slots=True)
class _Mechanism:
    """The kind of a mechanism, its dimensions, and the joints and the DH table that it has with them.

    Without the dimensions that decide on them there are no joints and no table.
    """

    name: str = ""
    dimensions: dict[str, Dimension] = field(default_factory=dict)
    joints: Mapping[str, Unit] = field(default_factory=dict)
    dh: DhTable | None = None


def _read_mechanism(value: Any, reading: FileReading) -> _Mechanism:
    """Return the mechanism of [kinematics], which the tables behind it are told."""
    if not isinstance(value, dict):
        raise InputError(f"{short(value)} is not a table")
    name = value.get("kind")
    if not isinstance(name, str) or name not in kinds():
        told = "is missing" if name is None else f"{short(name)} is not a text"
        reading.findings.add(f"kind: {told}" if not isinstance(name, str) else str(unknown("kind:", name, kinds())))
        raise UnreadError("kind")
    given = {key: each for key, each in value.items() if key != "kind"}
    geometry = read_table(kinds()[name].geometry, given, reading)
    mechanism: _Mechanism = reading.known
    mechanism.name = name
    with suppress(UnreadError):
        mechanism.joints = geometry.joints
    with suppress(UnreadError):
        mechanism.dh = geometry.dh
    for key in [each.name for each in fields(geometry) if each.name in given]:
        with suppress(UnreadError):
            mechanism.dimensions[key] = getattr(geometry, key)
    return mechanism


def _mechanism_schema() -> dict[str, Any]:
    """Return the JSON schema of [kinematics]: one table for each kind."""
    tables = []
    for name, kind in kinds().items():
        table = table_schema(kind.geometry)
        properties = {"kind": {"const": name, "description": kind.summary}, **table.get("properties", {})}
        required = ["kind", *table.get("required", ())]
        tables.append({**table, "properties": properties, "required": required, "description": kind.summary})
    return {"oneOf": tables}


# --- joints


@dataclass(frozen=True, slots=True)
class JointTable(FileTable):
    """A joint, which one axis of the board drives; a SCARA's joints have the names of its kind.

    Attributes:
        unit: unit of its positions; speeds are in this unit per second.
        lower: least position.
        upper: greatest position.
        speed_max: highest speed.
        acceleration_max: highest acceleration.
        jerk_max: highest jerk of fastest motions; the motion is averaged over twice the acceleration over it.
        full_steps_per_rev: full steps of the motor in one turn; 200 for the usual 1.8 deg.
        microsteps: microsteps per full step, as set at the driver.
        travel_per_turn: of a joint in mm: its travel per turn of the motor, a screw's lead or a pulley's circumference.
        ratio: of a joint in deg: turns of the motor per turn of the joint.
        axis_speed_max: highest speed of the axis, if it is coupled to other joints.
        axis_acceleration_max: highest acceleration of the axis, if it is coupled to other joints.
        current_a: phase current of the joint's own driver at full torque; by default that of the board.
        switches: positions of its switches.
        homing: how it is homed.
        second_motor: a second motor, with an axis of its own.
        motor: its motor, for the model of motors.
        link: the body that it moves, for the model of motors.
    """

    unit: Unit
    lower: float
    upper: float
    speed_max: Positive
    acceleration_max: Positive
    full_steps_per_rev: int
    microsteps: int
    travel_per_turn: Positive | None = None
    ratio: Positive | None = None
    axis_speed_max: Positive | None = None
    axis_acceleration_max: Positive | None = None
    current_a: float | None = None
    jerk_max: Positive | None = None
    switches: JointSwitches | None = None
    homing: JointHoming | None = None
    second_motor: SecondMotor | None = None
    motor: JointMotor | None = None
    link: JointLink | None = None

    @classmethod
    def strange(cls, key: str, value: object, keys: Collection[str]) -> str:
        """Return what to say of an unknown key: a table may be that of a feature."""
        return _strange_table(key, value, keys) or super(JointTable, cls).strange(key, value, keys)

    @classmethod
    def missing(cls, key: str, reading: FileReading) -> str:
        """Return what to say of a missing key; nothing for a joint of which `check_names` says that it is missing."""
        is_meant = not _headless(reading.table) and (reading.table or reading.name in reading.known.joints)
        return super(JointTable, cls).missing(key, reading) if is_meant else ""

    @classmethod
    def made_of(cls, values: dict[str, Any], reading: FileReading) -> Joint:
        """Return the joint, or the part of it that is right."""
        expected = reading.known.joints.get(reading.name)
        if reading.known.joints and not expected and (not reading.table or _headless(reading.table)):
            raise UnreadError(reading.name)  # it is probably another joint's: `check_names` says so
        unit = _probable_unit(reading.table, expected)
        with reading.findings.collecting("unit: "):
            if expected and "unit" in values:
                check_unit(values.pop("unit"), expected)
        turns = {key: values.pop(key) for key in _TURN.values() if key in values}
        motor: dict[str, Any] = {key: values.pop(key) for key in ("full_steps_per_rev", "microsteps") if key in values}
        for of_unit, key in _TURN.items():
            if of_unit is not unit and unit and turns.get(key) is not None:
                reading.findings.add(f"{key}: is for a joint in {of_unit}; one in {unit} has {_TURN[unit]}")
            elif of_unit is unit and key in turns and turns[key] is None:
                reading.findings.add(*(f"{key}: {told}" for told in [cls.missing(key, reading)] if told))
            elif of_unit is unit and key in turns:
                motor[key] = turns[key]
        motor |= {Unit.MM: {"ratio": 1.0}, Unit.DEG: {"travel_per_turn": 360.0}, None: {}}[unit]
        of_features = cls.__dataclass_fields__.keys() - JointTable.__dataclass_fields__.keys()
        tables = {name: values.pop(name) for name in [*values] if name in of_features}
        values["tables"] = {name: table for name, table in tables.items() if table is not None}
        given = {"name": reading.name, **values, **({"unit": unit} if unit else {})}
        return judged(Joint, {**given, "transmission": judged(Transmission, motor, reading.findings)}, reading.findings)


_TURN: Final = {Unit.MM: "travel_per_turn", Unit.DEG: "ratio"}
"""The key of the transmission, by the joint's unit."""
_TABLES_OF_A_JOINT: Final = frozenset({"switches", "homing", "second_motor", "motor", "link"})


def _tables_of_joints() -> dict[str, Any]:
    """Return the models of features' tables of a joint, by name."""
    return {name: model for _, tables in giving("joint_tables") for name, model in tables().items()}


def _strange_table(key: str, value: object, keys: Collection[str]) -> str:
    """Return what to say of an unknown table of a feature that is not there; nothing for a slip of the pen."""
    if isinstance(value, dict) and not nearest(key, keys):
        return f"{shortened(key)}: no feature that is installed has a table of this name"
    return ""


def _headless(joint: object) -> bool:
    """Return whether there are only tables of a joint, such as [joints.d3.homing], but nothing in [joints.d3]."""
    return isinstance(joint, dict) and bool(joint) and joint.keys() <= _TABLES_OF_A_JOINT | _tables_of_joints().keys()


def _probable_unit(table: Mapping[str, Any], expected: Unit | None) -> Unit | None:
    """Return the unit by which a joint's other keys are read: the file's, or the expected one if these keys fit it."""
    given = next((unit for unit in Unit if unit == table.get("unit")), expected)
    return expected if given and expected and _TURN[given] not in table and _TURN[expected] in table else given


# --- the whole file


@dataclass(frozen=True, slots=True)
class RobotFile(FileTable):
    """A robot for StepTwin: lengths in mm, angles in degrees, speeds per second.

    Attributes:
        name: name on the command line.
        title: title, one line.
        kinematics: kind of mechanism and its dimensions.
        board: settings that all axes share.
        joints: joints by name, in the order of their axes on the board.
        home: position of each joint that the machine takes after homing.
        base: where the base stands in the station, the frame of all poses and boxes.
        paper: paper that describes the machine, as a citation in one line.
        outputs: digital outputs of the board, by the name of the device wired to them.
        inputs: digital inputs of the board, by the name of the sensor wired to them.
        places: joint positions that jobs go to, by name; a place may name only some of the joints.
        boxes: what stands around the machine, by name.
        dynamics: supply and payload, for the model of motors.
        coupling: how far each axis moves for a unit of each joint, by axis and joint; by default 1 for its own joint.
        dh_errors: real minus nominal DH parameters, by link; they tell where the tool really is.
    """

    name: _Name
    title: Annotated[str, Name(TITLE_CHARS_MAX)]
    kinematics: Annotated[Any, ReadBy(_read_mechanism, _mechanism_schema)]
    board: BoardSettings
    joints: Mapping[_Name, Annotated[Joint, JointTable]]
    home: Mapping[str, float]
    base: BaseFrame | None = None
    paper: Annotated[str, Name(PAPER_CHARS_MAX)] = ""
    outputs: Mapping[_Name, Output] = field(default_factory=dict)
    inputs: Mapping[_Name, Input] = field(default_factory=dict)
    places: Mapping[_Name, Mapping[_Name, float]] = field(default_factory=dict)
    boxes: Mapping[_Name, Box] = field(default_factory=dict)
    dynamics: Dynamics | None = None
    coupling: Mapping[_Name, Mapping[_Name, float]] = field(default_factory=dict)
    dh_errors: Mapping[_Name, LinkErrors] = field(default_factory=dict)

    @classmethod
    def strange(cls, key: str, value: object, keys: Collection[str]) -> str:
        """Return what to say of an unknown key: a table may be that of a feature, unless it is a slip of the pen."""
        return _strange_table(key, value, keys) or super(RobotFile, cls).strange(key, value, keys)

    @classmethod
    def made_of(cls, values: dict[str, Any], reading: FileReading) -> Robot:
        """Return the robot, or the part of it that is right."""
        mechanism: _Mechanism = reading.known
        names = _joint_names(reading.file, mechanism)
        joints = _all_joints(values.pop("joints", {}), reading)
        coupling = _coupling(values.pop("coupling", None), names, joints, reading)
        if joints:
            values["joints"] = joints
            if coupling is not None:
                values["coupling"] = coupling
        if "home" in values:
            home = _home(values.pop("home"), names, reading)
            if joints:
                values["home"] = tuple(home.get(joint.name, _some_position(joint)) for joint in joints)
        if mechanism.dh and isinstance(links := reading.file.get("dh_errors"), dict):
            with reading.findings.collecting("dh_errors: "):
                check_links(mechanism.name, mechanism.dh, mechanism.joints, links)
        if "kinematics" in values:
            values["geometry"] = mechanism.dimensions
            values["kinematics"] = mechanism.name
        of_features = cls.__dataclass_fields__.keys() - RobotFile.__dataclass_fields__.keys()
        sections = {name: values.pop(name) for name in [*values] if name in of_features}
        values["sections"] = {name: section for name, section in sections.items() if section is not None}
        return judged(Robot, {**values, "toml": ""}, reading.findings)


def robot_model() -> type[Any]:
    """Return the model of robot files, with the tables of the features that are installed."""
    return _with_tables(
        tuple((feature.name, section) for feature, section in giving("section")), tuple(_tables_of_joints().items())
    )


@cache
def _with_tables(
    sections: tuple[tuple[str, Callable[[], type[Any]]], ...], of_joints: tuple[tuple[str, type[Any]], ...]
) -> type[Any]:
    own: list[Any] = [
        (name, Annotated[Any, ReadBy(partial(_read_section, model), partial(_section_schema, model))], None)
        for name, model in sections
    ]
    if of_joints:
        tables: list[Any] = [(name, Annotated[Any, model] | None, None) for name, model in of_joints]
        documented = {"__doc__": JointTable.__doc__}
        joint: Any = make_dataclass("JointTable", tables, bases=(JointTable,), frozen=True, namespace=documented)
        mapping: Any = Mapping  # mypy does not accept a computed type
        annotated: Any = Annotated
        own.append(("joints", mapping[_Name, annotated[Joint, joint]]))
    return make_dataclass("RobotFile", own, bases=(RobotFile,), frozen=True, namespace={"__doc__": RobotFile.__doc__})


def _read_section(model: Callable[[], type[Any]], value: Any, reading: FileReading) -> Any:
    return read_table(model(), value, reading)


def _section_schema(model: Callable[[], type[Any]]) -> dict[str, Any]:
    return table_schema(model())


def _joint_names(file: Mapping[str, Any], mechanism: _Mechanism) -> tuple[str, ...]:
    """Return the joints of the file, then those of the kind that it lacks."""
    joints = file.get("joints")
    return tuple(dict.fromkeys([*(joints if isinstance(joints, dict) else ()), *mechanism.joints]))


def _all_joints(read: Mapping[str, Joint], reading: FileReading) -> tuple[Joint, ...]:
    """Return the joints of the file and of the kind; of those that are wrong, the parts that are right."""
    mechanism: _Mechanism = reading.known
    table = reading.file.get("joints")
    if not isinstance(table, dict):
        return ()
    if mechanism.joints:
        with reading.findings.collecting():
            own = [name for name, joint in table.items() if name not in mechanism.joints or not _headless(joint)]
            check_names(mechanism.name, own, mechanism.joints)
    names = _joint_names(reading.file, mechanism)
    return tuple(read[name] if name in read else part_of(Joint, {"name": name}) for name in names)


def _some_position(joint: Joint) -> float:
    """Return a position that stands for an unread one, so that those of the other joints can be judged."""
    try:
        return joint.lower
    except UnreadError:
        return 0.0


def _home(home: Mapping[str, float], names: Iterable[str], reading: FileReading) -> Mapping[str, float]:
    """Return a position for every joint; those that only the file or only the kind has may be left out."""
    mechanism: _Mechanism = reading.known
    given, joints = reading.file["home"], reading.file.get("joints")
    names = [*(joints if isinstance(joints, dict) else given), *mechanism.joints]
    strange = [name for name in given if name not in names]
    meant = {name for each in strange for name in nearest(each, names)}
    sure = [name for name in dict.fromkeys(names) if name in mechanism.joints or not mechanism.joints]
    if isinstance(joints, dict):
        sure = [name for name in sure if name in joints]
    reading.findings.add(
        *(f"home.{shortened(name)}: {unknown('key', name, dict.fromkeys(names))}" for name in strange),
        *(f"home.{name}: is missing" for name in sure if name not in given and name not in meant),
    )
    return home


def _coupling(
    rows: Mapping[str, Mapping[str, float]] | None, names: Sequence[str], joints: Sequence[Joint], reading: FileReading
) -> Coupling | None:
    """Return the coupling with the second motors of the joints, as far as these could be read; None if it is wrong."""
    given = reading.file.get("coupling", {})
    tables = {axis: row for axis, row in given.items() if isinstance(row, dict)} if isinstance(given, dict) else {}
    before, coupling = len(reading.findings.messages), Coupling()
    with reading.findings.collecting("coupling: "):
        Coupling.check_names(names, tables)
    whole = isinstance(given, dict) and (rows or {}).keys() == given.keys()
    if not whole or any((rows or {})[axis].keys() != row.keys() for axis, row in tables.items()):
        return None
    with reading.findings.collecting("coupling: "):
        coupling = Coupling.of(names, rows or {})
    if len(reading.findings.messages) > before:
        return None
    seconds = []
    for i, joint in enumerate(joints):
        with suppress(UnreadError):
            seconds += [i] if joint.second_motor else []
    return coupling.with_second_motors(len(joints), seconds)


def _check_speeds(robot: Robot) -> None:
    """Raise InputError if joints' highest speeds need higher step rates than the driver's limit."""
    check_all(*(partial(_check_speed, joint, robot.board) for joint in robot.joints))


def _check_speed(joint: Joint, board: BoardSettings) -> None:
    limit_hz = board.driver_rate_max_hz
    if joint.step_rate_max_hz > limit_hz * (1 + _ROUNDING):
        key, speed = (
            ("axis_speed_max", joint.axis_speed_max) if joint.axis_speed_max else ("speed_max", joint.speed_max)
        )
        rate, limit = apart(joint.step_rate_max_hz / 1e3, limit_hz / 1e3)
        fastest = at_most(limit_hz / joint.transmission.steps_per_unit * (1 + _ROUNDING / 2))
        _, drive = with_fewer_steps(joint, limit_hz / joint.step_rate_max_hz, board.profile.chip.microsteps)
        raise InputError(
            f"joints.{joint.name}.{key}: {speed:g} {joint.unit}/s takes {rate} kHz of steps,"
            f" more than the driver's {limit} kHz; {key} = {fastest} or {drive} would do"
        )
