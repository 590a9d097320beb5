"""StepTwin: a firmware-faithful twin of STM32 + TB6560 stepper boards.

These are the names that most programs need; docs/api.md describes each. A name is imported when it is first used, so
`import steptwin` takes only milliseconds.
"""

from importlib import import_module

TYPE_CHECKING = False  # as typing's, which takes longer to import than all else here
if TYPE_CHECKING:
    from steptwin.emulator.bus_faults import BusFault, BusFaultKind, FaultScript
    from steptwin.emulator.operations import (
        Babble,
        BoardTemperature,
        BouncingSwitch,
        BrownOut,
        BusOff,
        Contact,
        DriverMode,
        DriverProtect,
        EmergencyStop,
        OscCapacitor,
        Payload,
        PowerUp,
        Scheduled,
        SetInput,
        SetWire,
        Slip,
        StrangerSends,
        StuckSwitch,
        Supply,
        SwitchWire,
        WatchdogReset,
    )
    from steptwin.emulator.wires import Noise, Wire, WireState
    from steptwin.host.common.errors import (
        BusError,
        DeviceFaultError,
        InputError,
        NotVerifiedError,
        RecordingError,
        StepTwinError,
        WaitTimeoutError,
    )
    from steptwin.host.planning.errand import Carry, Errand
    from steptwin.host.planning.jobs import job_carries, job_names, job_options, make_job
    from steptwin.host.planning.laws import Cubic, Quintic, SCurve, Trapezoid
    from steptwin.host.planning.motions.composer import Composer
    from steptwin.host.planning.motions.sampled import Sampled
    from steptwin.host.planning.plan import Plan
    from steptwin.host.planning.planner import plan, plan_stretched
    from steptwin.host.planning.programs import compile_program, read_program
    from steptwin.host.planning.trajectory import Trajectory
    from steptwin.host.planning.trajectory_file import read_trajectory
    from steptwin.host.robots import load_robot, robot_names
    from steptwin.host.robots.calibration import (
        Identification,
        Measurements,
        identify_errors,
        read_measurements,
        simulate_measurements,
    )
    from steptwin.host.robots.kinematics.chain import Chain
    from steptwin.host.robots.robot import Robot
    from steptwin.host.twin.board_under_test import BoardUnderTest
    from steptwin.host.twin.execution import execute
    from steptwin.host.twin.input_changes import InputChange
    from steptwin.host.twin.kernels import kernel_named
    from steptwin.host.twin.outcome import Outcome
    from steptwin.host.twin.scenarios.harms import BusRepair, HostFault, HostFaultKind
    from steptwin.host.twin.scenarios.not_begun import NotBegunError
    from steptwin.host.twin.scenarios.reaction import Motion, Reaction
    from steptwin.host.twin.scenarios.reading import read_scenario
    from steptwin.host.twin.scenarios.scenario import Fault, Scenario
    from steptwin.host.twin.scenarios.triggers import (
        AtPosition,
        AtRandom,
        AtState,
        AtTime,
        Direction,
        OnFrame,
    )
    from steptwin.host.twin.served_board import ServedBoard
    from steptwin.host.twin.served_board_under_test import ServedBoardUnderTest
    from steptwin.protocol.eds import render_eds
    from steptwin.protocol.frame import Frame

__version__ = "0.1.0"

__all__ = [
    "AtPosition",
    "AtRandom",
    "AtState",
    "AtTime",
    "Babble",
    "BoardTemperature",
    "BoardUnderTest",
    "BouncingSwitch",
    "BrownOut",
    "BusError",
    "BusFault",
    "BusFaultKind",
    "BusOff",
    "BusRepair",
    "Carry",
    "Chain",
    "Composer",
    "Contact",
    "Cubic",
    "DeviceFaultError",
    "Direction",
    "DriverMode",
    "DriverProtect",
    "EmergencyStop",
    "Errand",
    "Fault",
    "FaultScript",
    "Frame",
    "HostFault",
    "HostFaultKind",
    "Identification",
    "InputChange",
    "InputError",
    "Measurements",
    "Motion",
    "Noise",
    "NotBegunError",
    "NotVerifiedError",
    "OnFrame",
    "OscCapacitor",
    "Outcome",
    "Payload",
    "Plan",
    "PowerUp",
    "Quintic",
    "Reaction",
    "RecordingError",
    "Robot",
    "SCurve",
    "Sampled",
    "Scenario",
    "Scheduled",
    "ServedBoard",
    "ServedBoardUnderTest",
    "SetInput",
    "SetWire",
    "Slip",
    "StepTwinError",
    "StrangerSends",
    "StuckSwitch",
    "Supply",
    "SwitchWire",
    "Trajectory",
    "Trapezoid",
    "WaitTimeoutError",
    "WatchdogReset",
    "Wire",
    "WireState",
    "compile_program",
    "execute",
    "identify_errors",
    "job_carries",
    "job_names",
    "job_options",
    "kernel_named",
    "load_robot",
    "make_job",
    "plan",
    "plan_stretched",
    "read_measurements",
    "read_program",
    "read_scenario",
    "read_trajectory",
    "render_eds",
    "robot_names",
    "simulate_measurements",
]

_MODULES = {
    "emulator.bus_faults": ("BusFault", "BusFaultKind", "FaultScript"),
    "emulator.operations": (
        "Babble",
        "BoardTemperature",
        "BouncingSwitch",
        "BrownOut",
        "BusOff",
        "Contact",
        "DriverMode",
        "DriverProtect",
        "EmergencyStop",
        "OscCapacitor",
        "Payload",
        "PowerUp",
        "Scheduled",
        "SetInput",
        "SetWire",
        "Slip",
        "StrangerSends",
        "StuckSwitch",
        "Supply",
        "SwitchWire",
        "WatchdogReset",
    ),
    "emulator.wires": ("Noise", "Wire", "WireState"),
    "protocol.frame": ("Frame",),
    "host.common.errors": (
        "BusError",
        "DeviceFaultError",
        "InputError",
        "NotVerifiedError",
        "RecordingError",
        "StepTwinError",
        "WaitTimeoutError",
    ),
    "host.planning.errand": ("Carry", "Errand"),
    "host.planning.jobs": ("job_carries", "job_names", "job_options", "make_job"),
    "host.planning.laws": ("Cubic", "Quintic", "SCurve", "Trapezoid"),
    "host.planning.motions.composer": ("Composer",),
    "host.planning.motions.sampled": ("Sampled",),
    "host.planning.plan": ("Plan",),
    "host.planning.planner": ("plan", "plan_stretched"),
    "host.planning.programs": ("compile_program", "read_program"),
    "host.planning.trajectory": ("Trajectory",),
    "host.planning.trajectory_file": ("read_trajectory",),
    "host.robots": ("load_robot", "robot_names"),
    "host.robots.calibration": (
        "Identification",
        "Measurements",
        "identify_errors",
        "read_measurements",
        "simulate_measurements",
    ),
    "host.robots.kinematics.chain": ("Chain",),
    "host.robots.robot": ("Robot",),
    "host.twin.board_under_test": ("BoardUnderTest",),
    "host.twin.execution": ("execute",),
    "host.twin.input_changes": ("InputChange",),
    "host.twin.kernels": ("kernel_named",),
    "host.twin.outcome": ("Outcome",),
    "host.twin.scenarios.harms": ("BusRepair", "HostFault", "HostFaultKind"),
    "host.twin.scenarios.not_begun": ("NotBegunError",),
    "host.twin.scenarios.reaction": ("Motion", "Reaction"),
    "host.twin.scenarios.reading": ("read_scenario",),
    "host.twin.scenarios.scenario": ("Fault", "Scenario"),
    "host.twin.scenarios.triggers": ("AtPosition", "AtRandom", "AtState", "AtTime", "Direction", "OnFrame"),
    "host.twin.served_board": ("ServedBoard",),
    "host.twin.served_board_under_test": ("ServedBoardUnderTest",),
    "protocol.eds": ("render_eds",),
}
"""Public names by the module that defines each; the imports above say the same to type checkers."""
_MODULE_OF = {name: module for module, names in _MODULES.items() for name in names}


if not TYPE_CHECKING:  # hidden from type checkers, so that they report unknown names

    def __getattr__(name: str) -> object:
        """Import a public name when it is first used (PEP 562)."""
        if name not in _MODULE_OF:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        value = globals()[name] = getattr(import_module(f"{__name__}.{_MODULE_OF[name]}"), name)
        return value


def __dir__() -> list[str]:
    """List the public names, whether imported yet or not."""
    return [*__all__, "__version__"]
