"""Describe a robot's board for ros2_canopen: bus.yml, the nodes' EDS, ros2_control's description, the URDF.

ros2_canopen's Cia402Driver drives one axis a node. With each SYNC it receives statusword, mode, position and velocity,
and sends controlword, mode, target position and velocity. Its units are rad and m; it multiplies positions by
`scale_pos_to_dev` on their way to a node. All PDOs go with SYNC, so controlword and target act together. File names,
keys and driver names follow its documentation and its tests.
"""

from math import pi
from typing import Final
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from steptwin.features.urdf.urdf_export import urdf_of
from steptwin.host.common.errors import InputError
from steptwin.host.operate.homing import homing_settings
from steptwin.host.operate.setting_up import axis_settings
from steptwin.host.robots.joint import Joint, Unit
from steptwin.host.robots.robot import Robot
from steptwin.protocol import od
from steptwin.protocol.cia402 import Mode
from steptwin.protocol.exports import render_eds
from steptwin.protocol.frame import FIRST_NODE_ID, HOST_NODE_ID
from steptwin.protocol.homing_methods import NO_HOMING

PERIOD_MS: Final = 10
"""Period of SYNC and of the drivers: a setpoint each 10 ms."""
_HEARTBEAT_MS: Final = 100
_HOLD_AFTER_QUICK_STOP: Final = 6
_PER_RAD_OR_M: Final = {Unit.DEG: 180.0 / pi, Unit.MM: 1000.0}

_HEAD: Final = """\
# {robot}: bus configuration for ros2_canopen, written by `steptwin ros2`.
# @BUS_CONFIG_PATH@ is replaced by CMake's generate_dcf of lely_core_libraries.
options:
  dcf_path: "@BUS_CONFIG_PATH@"

master:
  node_id: {host}
  driver: "ros2_canopen::MasterDriver"
  package: "canopen_master_driver"
  sync_period: {sync_us}
  heartbeat_producer: {heartbeat_ms}
"""

_NODE: Final = """
{name}:
  dcf: "axis.eds"
  node_id: {node_id}
  driver: "ros2_canopen::Cia402Driver"
  package: "canopen_402_driver"
  period: {period_ms}
  polling: false
  position_mode: {mode}
  heartbeat_producer: {heartbeat_ms}
  scale_pos_to_dev: {to_dev:.6f}   # wire units in a {unit}
  scale_pos_from_dev: {from_dev:.12g}
  scale_vel_to_dev: {to_dev:.6f}
  scale_vel_from_dev: {from_dev:.12g}
  homing_timeout_seconds: {homing_s}
  tpdo:
    1:
      enabled: true
      cob_id: auto
      transmission: 1
      mapping:
        - {{index: 0x6041, sub_index: 0}}
        - {{index: 0x6061, sub_index: 0}}
    2:
      enabled: true
      cob_id: auto
      transmission: 1
      mapping:
        - {{index: 0x6064, sub_index: 0}}
        - {{index: 0x606C, sub_index: 0}}
  rpdo:
    1:
      enabled: true
      cob_id: auto
      transmission: 1
      mapping:
        - {{index: 0x6040, sub_index: 0}}
        - {{index: 0x6060, sub_index: 0}}
    2:
      enabled: true
      cob_id: auto
      transmission: 1
      mapping:
        - {{index: 0x607A, sub_index: 0}}
        - {{index: 0x60FF, sub_index: 0}}
  sdo:
{sdo}
"""

_README: Final = """\
# {robot} with ros2_canopen

Written by `steptwin ros2`. None of it was ever run with ROS: `dcfgen` takes bus.yml, and the driver's cycle was tried
against the emulated board.

- `bus.yml`, `axis.eds`: put them into the package's config folder, and let CMake's `generate_dcf` make master.dcf.
- `ros2_control.urdf`: what belongs into the robot's description; say where bus.yml and master.dcf are.
{urdf}
Without a board: `steptwin serve {robot}` and a vcan (docs/live.md), or a real interface on both sides.

What to know:

- Mode 7 (interpolated position) takes records by a queue here, not a position each cycle: use mode 8 or 1.
- Homing goes by bus.yml's 0x6098, method {methods}.
- A first target after homing on a limit switch must lead away from it, or the axis stops with 0x8612.
"""


def ros2_files(robot: Robot) -> dict[str, str]:
    """Return the text of each file, by its name.

    Raises:
        InputError: the joints are coupled, or one has two motors: ros2_canopen drives each axis by itself.
    """
    if robot.coupling.matrix or len(robot.axes) != len(robot.joints):
        raise InputError(
            f"{robot.name}: its joints are coupled or have two motors; ros2_canopen drives axes one by one"
        )
    files = {"bus.yml": _bus(robot), "axis.eds": render_eds(), "ros2_control.urdf": _control(robot)}
    try:
        files[f"{robot.name}.urdf"] = urdf_of(robot)
        urdf = f"- `{robot.name}.urdf`: the arm's links and joints."
    except InputError as error:
        urdf = f"- No URDF: {error}."
    methods = ", ".join(dict.fromkeys(str(each.homing.method) if each.homing else "none" for each in robot.joints))
    files["README.md"] = _README.format(robot=robot.name, urdf=urdf, methods=methods)
    return files


def scale_to_dev(joint: Joint) -> float:
    """Return the wire units for a rad or m of a joint."""
    return joint.transmission.wire_units_per_unit * _PER_RAD_OR_M[joint.unit]


def _bus(robot: Robot) -> str:
    head = _HEAD.format(robot=robot.name, host=HOST_NODE_ID, sync_us=1000 * PERIOD_MS, heartbeat_ms=_HEARTBEAT_MS)
    return head + "".join(_node(robot, joint, FIRST_NODE_ID + i) for i, joint in enumerate(robot.joints))


def _node(robot: Robot, joint: Joint, node_id: int) -> str:
    homing = homing_settings(joint)
    objects = [
        *axis_settings(joint, robot.board).objects(),
        (od.QUICK_STOP_OPTION, _HOLD_AFTER_QUICK_STOP),
        (od.INTERPOLATION_PERIOD, PERIOD_MS),
        (od.INTERPOLATION_PERIOD_EXPONENT, -3),
        *(homing.objects() if homing else [(od.HOMING_METHOD, NO_HOMING)]),
    ]
    to_dev = scale_to_dev(joint)
    return _NODE.format(
        name=joint.name,
        node_id=node_id,
        period_ms=PERIOD_MS,
        mode=Mode.CYCLIC_SYNCHRONOUS_POSITION.value,
        heartbeat_ms=_HEARTBEAT_MS,
        to_dev=to_dev,
        from_dev=1.0 / to_dev,
        unit="m" if joint.unit is Unit.MM else "rad",
        homing_s=-(-homing.timeout_ms // 1000) if homing else 10,
        sdo="\n".join(_sdo_line(address, int(value)) for address, value in objects),
    )


def _sdo_line(address: int, value: int) -> str:
    index, subindex = od.index_and_subindex(address)
    return f"    - {{index: 0x{index:04X}, sub_index: {subindex}, value: {value}}}"


def _control(robot: Robot) -> str:
    """Return the tag of ros2_control for the robot's description."""
    root = Element("ros2_control", name=robot.name, type="system")
    hardware = SubElement(root, "hardware")
    SubElement(hardware, "plugin").text = "canopen_ros2_control/RobotSystem"
    for name, text in (
        ("bus_config", "[path to bus.yml]"),
        ("master_config", "[path to master.dcf]"),
        ("can_interface_name", "can0"),
        ("master_bin", ""),
    ):
        SubElement(hardware, "param", name=name).text = text
    for i, joint in enumerate(robot.joints):
        tag = SubElement(root, "joint", name=joint.name)
        SubElement(tag, "param", name="device_name").text = joint.name
        SubElement(tag, "param", name="node_id").text = str(FIRST_NODE_ID + i)
        for name in ("position", "velocity"):
            SubElement(tag, "command_interface", name=name)
            SubElement(tag, "state_interface", name=name)
    indent(root)
    return tostring(root, encoding="unicode") + "\n"
