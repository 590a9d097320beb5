"""A robot as data: its joints, the board that drives them, its dimensions and named positions."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from operator import attrgetter
from typing import Any, Final

import numpy as np

from steptwin.host.common.arrays import FloatArray, Int64Array
from steptwin.host.common.bad_input import at_most, nearest_within, outside, prefixed, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.common.features import RobotSection
from steptwin.host.common.findings import Findings, check_all
from steptwin.host.robots.board_settings import BoardSettings, Input, Output
from steptwin.host.robots.box import Box
from steptwin.host.robots.coupling import Coupling
from steptwin.host.robots.joint import WIRE_POSITION_MAX, Joint, second_axis
from steptwin.host.robots.link_errors import LinkErrors
from steptwin.host.robots.motor import Dynamics
from steptwin.host.robots.poses.base_frame import STATION, BaseFrame
from steptwin.host.robots.switches import JointHoming

AXES_MAX: Final = 8
"""Axes that a board drives: two 16-bit timers with four compare channels each."""

Dimension = Any
"""A dimension of a mechanism in mm or degrees, one of its options, or what its kind makes of a table or a list."""


@dataclass(frozen=True, slots=True)
class Robot:
    """A machine, as its robot file describes it.

    Attributes:
        name: name on the command line.
        title: title, one line.
        kinematics: kind of mechanism, a name that `steptwin.host.robots.kinematics` knows.
        geometry: dimensions of the mechanism in mm and degrees, and its options, by name.
        joints: joints, in the order of their axes on the board; axes of second motors are behind them.
        home: joint positions, in joint order, that the machine takes after homing.
        board: settings that all axes share.
        outputs: digital outputs of the board, by the name of the device wired to them.
        inputs: digital inputs of the board, by the name of the sensor wired to them.
        places: joint positions that jobs go to, by name; a place may name only some of the joints.
        boxes: what stands around the machine, by name; pictures show it, and features may work with them.
        sections: tables of the file that features have read, by their names.
        coupling: how the axes follow the joints; by default each joint has a motor of its own.
        dh_errors: errors of the DH parameters, by the name of the link: no motion is planned by them; they tell where
            the tool really is.
        base: position of the base in the station, the frame of all poses and boxes.
        paper: paper that describes the machine, as a citation in one line; may be empty.
        dynamics: supply and payload, for the model of motors and mechanics; None: unknown.
        toml: text of the robot file; empty for a robot that was not read from a file.

    Raises:
        InputError: no joints or more motors than a board drives, two axes of one name, a position outside a joint's
            limits, a place without joints,
            an output or input of an unknown joint, two of them at one connector, a box held by an unknown output, a
            section that names what the robot does not have, or an axis that cannot be coupled so.
    """

    name: str
    title: str
    kinematics: str
    geometry: Mapping[str, Dimension] = field(hash=False)
    joints: tuple[Joint, ...]
    home: tuple[float, ...]
    board: BoardSettings
    outputs: Mapping[str, Output] = field(default_factory=dict, hash=False)
    inputs: Mapping[str, Input] = field(default_factory=dict, hash=False)
    places: Mapping[str, Mapping[str, float]] = field(default_factory=dict, hash=False)
    boxes: Mapping[str, Box] = field(default_factory=dict, hash=False)
    sections: Mapping[str, RobotSection] = field(default_factory=dict, hash=False)
    coupling: Coupling = field(default_factory=Coupling)
    dh_errors: Mapping[str, LinkErrors] = field(default_factory=dict, hash=False)
    base: BaseFrame = STATION
    paper: str = ""
    dynamics: Dynamics | None = None
    toml: str = field(default="", repr=False, compare=False)

    def __post_init__(self) -> None:
        if not 1 <= len(self.joints) <= AXES_MAX:
            raise InputError(f"joints: {len(self.joints)} joints, but a board drives 1 to {AXES_MAX}")
        check_all(
            self._check_second_motors,
            self._check_home,
            self._check_places,
            self._check_outputs,
            self._check_inputs,
            self._check_boxes,
            self._check_sections,
            self._check_payload,
            self._check_supply,
            *(partial(self._check_microsteps, joint) for joint in self.joints),
            *(partial(self._check_current, joint) for joint in self.joints),
            *(partial(self._check_axis, axis) for axis in range(len(self.joints))),
        )

    def _check_second_motors(self) -> None:
        """Check the names of second motors' axes, their number, and that the coupling has them."""
        findings, taken = Findings(), set(self.joint_names)
        for joint in self.joints:
            if (motor := joint.second_motor) and motor.name in taken:
                findings.add(f"joints.{joint.name}.second_motor.name: {motor.name} is the name of another axis")
            taken |= {motor.name} if motor else set()
        findings.raise_first()
        if len(self.axes) > AXES_MAX:
            raise InputError(f"joints: {len(self.axes)} motors, but a board drives 1 to {AXES_MAX}")
        if self.coupling.seconds != self.second_motors:
            raise ValueError("the coupling has other second motors than the joints")

    def _check_home(self) -> None:
        self._check_place("home", dict(zip(self.joint_names, self.home, strict=True)))

    def _check_places(self) -> None:
        check_all(*(partial(self._check_place, f"places.{name}", place) for name, place in self.places.items()))

    def _check_outputs(self) -> None:
        self._check_wires("output", self.outputs, attrgetter("joint", "out"))

    def _check_inputs(self) -> None:
        self._check_wires("input", self.inputs, attrgetter("joint", "input"))

    def _check_wires(
        self, what: str, wired: Mapping[str, Output | Input], connector: Callable[[Output | Input], tuple[str, int]]
    ) -> None:
        """Check the joints of all outputs or inputs, and that each is at a connector of its own."""
        findings, first_at = Findings(), dict[tuple[str, int], str]()
        for name, device in wired.items():
            with findings.collecting(f"{what}s.{name}"):
                if device.joint not in self.axis_names:
                    raise unknown(".joint:", device.joint, self.axis_names)
                joint, number = connector(device)
                first = first_at.setdefault((joint, number), name)
                if first != name:
                    raise InputError(f": {what} {number} of {joint} is already wired to {first}")
        findings.raise_first()

    def _check_boxes(self) -> None:
        findings = Findings()
        for name, box in self.boxes.items():
            with findings.collecting(f"boxes.{name}"):
                if box.held_by and box.held_by not in self.outputs:
                    raise unknown(".held_by: output", box.held_by, self.outputs)
        findings.raise_first()

    def _check_sections(self) -> None:
        check_all(*(partial(section.check, self) for section in self.sections.values()))

    def _check_payload(self) -> None:
        holder = self.dynamics.payload_held_by if self.dynamics else ""
        if holder and holder not in self.outputs:
            raise unknown("dynamics.payload_held_by: output", holder, self.outputs)

    def _check_supply(self) -> None:
        if self.dynamics:
            low_v, high_v = self.board.profile.chip.supply_v.value
            if not low_v <= self.dynamics.supply_v <= high_v:
                raise InputError(
                    f"dynamics.supply_v: {self.dynamics.supply_v:g} V is outside {low_v:g}..{high_v:g} V,"
                    f" the {self.board.profile.chip.name}'s operating range"
                )

    def _check_microsteps(self, joint: Joint) -> None:
        """Check that the drivers have a joint's microsteps."""
        try:
            self.board.profile.mode(joint.transmission.microsteps)
        except ValueError as error:
            raise InputError(f"joints.{joint.name}.microsteps: {error}") from error

    def _check_current(self, joint: Joint) -> None:
        """Check that the drivers have a joint's own current."""
        with prefixed(f"joints.{joint.name}."):
            self.board_at(joint)

    def board_at(self, joint: Joint) -> BoardSettings:
        """Return the board's settings at a joint: with the current of the joint's own driver, if it has one."""
        return self.board if joint.current_a is None else replace(self.board, current_a=joint.current_a)

    def _check_place(self, key: str, place: Mapping[str, float]) -> None:
        if not place:
            raise InputError(f"{key}: names no joint")
        check_all(*(partial(self._check_position, key, name, position) for name, position in place.items()))

    def _check_position(self, key: str, name: str, position: float) -> None:
        if name not in self.joint_names:
            raise unknown(f"{key}: joint", name, self.joint_names)
        joint = self.joint(name)
        if not joint.lower <= position <= joint.upper:
            limits = (joint.lower, joint.upper, joint.unit)
            raise InputError(f"{key}.{name}: {outside(position, *limits)}{nearest_within(position, *limits)}")

    def _check_axis(self, axis: int) -> None:
        """Check what depends on the coupling of an axis' joint to the others."""
        joint, elements = self.joints[axis], self.coupling.joints_of(axis)
        if not self.coupling.couples(axis):
            for key in ("axis_speed_max", "axis_acceleration_max"):
                if getattr(joint, key) is not None:
                    raise InputError(f"joints.{joint.name}.{key}: is for a coupled axis; {key[5:]} is its limit here")
            return
        if joint.link and (joint.link.stop_lower is not None or joint.link.stop_upper is not None):
            key = "stop_upper" if joint.link.stop_lower is None else "stop_lower"
            raise InputError(
                f"joints.{joint.name}.link.{key}: {getattr(joint.link, key):g} {joint.unit} is for a joint that its own"
                " motor alone moves, but this one is coupled; leave it out"
            )
        reach = WIRE_POSITION_MAX / joint.transmission.wire_units_per_unit
        ends = ((self.joints[other].lower, self.joints[other].upper) for other in elements)
        farthest = sum(
            abs(element) * max(map(abs, pair)) for element, pair in zip(elements.values(), ends, strict=True)
        )
        if farthest > reach:
            raise InputError(
                f"coupling.{joint.name}: the axis goes up to {farthest:g} {joint.unit} from zero,"
                f" beyond the wire's {reach:g} {joint.unit}"
            )
        if joint.homing:
            self._check_homing(axis, joint.homing)

    def _check_homing(self, axis: int, homing: JointHoming) -> None:
        joint, coupling = self.joints[axis], self.coupling
        mutual = coupling.mutual(axis)
        if len(mutual) > 1 and (doubled := [self.joints[other] for other in mutual if self.joints[other].second_motor]):
            raise InputError(
                f"joints.{joint.name}.homing: joints that depend on each other cannot be homed where one has a second"
                f" motor, as {doubled[0].name} has; leave the homing out and declare where the joints stand"
                " (`steptwin home --here`)"
            )
        for moved, element in coupling.homing_axes(axis).items():
            for key, value, limit in (
                ("search_speed", homing.search_speed, self.axis_speeds_max[moved]),
                ("acceleration", homing.acceleration, self.axis_accelerations_max[moved]),
            ):
                if abs(element) * value > limit:
                    which = "the axis" if moved == axis else f"{self.axis_names[moved]}'s axis"
                    raise InputError(
                        f"joints.{joint.name}.homing.{key}: {value:g} moves {which} at {abs(element) * value:g},"
                        f" above its limit of {limit:g}; {at_most(limit / abs(element))} is right"
                    )

    @property
    def joint_names(self) -> tuple[str, ...]:
        """The names of the joints, in axis order."""
        return tuple(joint.name for joint in self.joints)

    @property
    def second_motors(self) -> tuple[int, ...]:
        """The joints that have a second motor."""
        return tuple(i for i, joint in enumerate(self.joints) if joint.second_motor)

    @property
    def axes(self) -> tuple[Joint, ...]:
        """The axes in the order of their nodes: those of the joints, then those of second motors.

        An axis is described like a joint: what it has of its own is its name, its drive and its switches.
        """
        return (*self.joints, *(second_axis(each, each.second_motor) for each in self.joints if each.second_motor))

    @property
    def axis_names(self) -> tuple[str, ...]:
        """The names of the axes, in the order of their nodes."""
        return tuple(axis.name for axis in self.axes)

    def index_of(self, name: str) -> int:
        """Return the index of a joint; raise InputError with the nearest names for an unknown one."""
        if name not in self.joint_names:
            raise unknown("joint", name, self.joint_names)
        return self.joint_names.index(name)

    def axis_index(self, name: str) -> int:
        """Return the index of an axis by its name or its joint's; raise InputError for an unknown one."""
        if name not in self.axis_names:
            raise unknown("joint", name, self.axis_names)
        return self.axis_names.index(name)

    def joint(self, name: str) -> Joint:
        """Return a joint by its name; raise KeyError for an unknown name."""
        return {joint.name: joint for joint in self.joints}[name]

    @property
    def steps_per_unit(self) -> FloatArray:
        """Shape (axes,): steps per mm or degree of an axis position, which is the joint's unless joints are coupled."""
        return np.array([axis.transmission.steps_per_unit for axis in self.axes])

    @property
    def wire_units_per_unit(self) -> FloatArray:
        """Shape (axes,): wire units per mm or degree of an axis position."""
        return np.array([axis.transmission.wire_units_per_unit for axis in self.axes])

    def to_units(self, positions: FloatArray) -> FloatArray:
        """Return the axes' wire units at joint positions, shape (..., joints): whole numbers, half a unit rounded up.

        They stay floats, which have no bound, so that the caller can check them before they become integers.
        """
        return np.asarray(np.floor(self.coupling.to_axes(positions) * self.wire_units_per_unit + 0.5))

    def to_positions(self, units: FloatArray | Int64Array) -> FloatArray:
        """Return the joint positions, in mm and degrees, at wire units of all axes, shape (..., axes)."""
        return self.coupling.to_joints(np.asarray(units / self.wire_units_per_unit))

    def to_steps(self, joints: FloatArray) -> FloatArray:
        """Return the positions or speeds of the axes in driver steps, from joints' of shape (..., joints)."""
        return np.asarray(self.coupling.to_axes(joints) * self.steps_per_unit)

    def from_steps(self, steps: FloatArray | Int64Array) -> FloatArray:
        """Return the joint positions at positions of all axes in driver steps, shape (..., axes)."""
        return self.coupling.to_joints(np.asarray(steps / self.steps_per_unit))

    def skews(self, units: FloatArray | Int64Array) -> FloatArray:
        """Return how far each second motor is ahead of the first, at wire units of all axes, in mm or degrees."""
        return self.coupling.skews(np.asarray(units / self.wire_units_per_unit))

    def axis_position_text(self, axis: int) -> str:
        """Return the equation of an axis' position, such as "axis position = 1 th1 + 1 th2"; "" for its joint's."""
        if axis == self.coupling.joint_of(axis) and not self.coupling.couples(axis):
            return ""
        terms = (f"{element:g} {self.joint_names[joint]}" for joint, element in self.coupling.joints_of(axis).items())
        return f"axis position = {' + '.join(terms)}"

    @property
    def has_motors(self) -> bool:
        """True if its file describes all motors, masses and the supply."""
        return self.dynamics is not None and all(joint.motor and joint.link for joint in self.joints)

    @property
    def axis_speeds_max(self) -> FloatArray:
        """Shape (axes,): highest speed of each axis, in mm/s or deg/s."""
        return np.array([axis.axis_speed_max or axis.speed_max for axis in self.axes])

    @property
    def axis_accelerations_max(self) -> FloatArray:
        """Shape (axes,): highest acceleration of each axis, in mm/s^2 or deg/s^2."""
        return np.array([axis.axis_acceleration_max or axis.acceleration_max for axis in self.axes])
