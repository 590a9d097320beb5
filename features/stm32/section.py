"""The table `[stm32]` of a robot file: the chip's memory and crystal, and what its pins are wired to."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Final

from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_models import FileTable
from steptwin.host.common.file_values import Within, check_limits
from steptwin.host.common.findings import Findings
from steptwin.host.robots.robot import Robot
from steptwin.protocol.cia402 import DigitalInput

_PIN: Final = re.compile(r"(!?)P([A-E])([0-9]|1[0-5])")
OUTPUTS: Final = ("step", "dir", "enable")
INPUTS: Final = {
    "negative_limit": DigitalInput.NEGATIVE_LIMIT,
    "positive_limit": DigitalInput.POSITIVE_LIMIT,
    "home": DigitalInput.HOME,
    "estop": DigitalInput.ESTOP,
    "protect": DigitalInput.DRIVER_PROTECT,
}
"""Keys of a joint's input pins, and what they read."""


@dataclass(frozen=True, slots=True)
class ChipPin:
    """A pin of the chip: 16 * port + pin, and whether what it is wired to has the inverse of its level."""

    number: int
    inverted: bool = False

    @classmethod
    def of(cls, text: str) -> "ChipPin":
        """Return the pin of a text such as PA0, or !PA4 for an inverted one."""
        found = _PIN.fullmatch(text)
        if not found:
            raise InputError(f"{text!r}: is no pin from PA0 to PE15, such as PA0, or !PA0 for an inverted one")
        return cls(16 * (ord(found[2]) - ord("A")) + int(found[3]), bool(found[1]))

    @property
    def name(self) -> str:
        """Its name, such as PA0."""
        return f"P{'ABCDE'[self.number // 16]}{self.number % 16}"


def analog_channel(pin: ChipPin) -> int | None:
    """Return the ADC's channel of a pin; None if it has none (RM0008, 11.3.3; the datasheet's table 5)."""
    channels = {**{i: i for i in range(8)}, 16: 8, 17: 9, **{32 + i: 10 + i for i in range(6)}}
    return channels.get(pin.number)


@dataclass(frozen=True, slots=True)
class JointPins(FileTable):
    """Pins of an STM32F103 at one joint's driver and switches, such as PA0, or !PA0 for an inverted one.

    Attributes:
        step: of STEP.
        dir: of DIR.
        enable: of ENABLE; empty: the driver is always on.
        negative_limit: input that reads the negative limit switch; empty: none does.
        positive_limit: likewise for the positive one.
        home: likewise for the home switch.
        estop: likewise for the emergency stop.
        protect: likewise for the driver's fault output.
    """

    step: str
    dir: str
    enable: str = ""
    negative_limit: str = ""
    positive_limit: str = ""
    home: str = ""
    estop: str = ""
    protect: str = ""

    def __post_init__(self) -> None:
        findings = Findings()
        for key in (*OUTPUTS, *INPUTS):
            if text := getattr(self, key):
                with findings.collecting(f"{key}: "):
                    ChipPin.of(text)
        findings.raise_first()

    def pin(self, key: str) -> ChipPin | None:
        """Return the pin of a key; None if it has none."""
        text = getattr(self, key)
        return ChipPin.of(text) if text else None


@dataclass(frozen=True, slots=True)
class Stm32(FileTable):
    """The STM32F103 that drives the robot, for `steptwin run-image`; its pins stand in the joints' tables.

    Attributes:
        flash_kb: size of the flash: 64 for an STM32F103C8, whose other half mostly works as well.
        ram_kb: size of the RAM.
        crystal_hz: frequency of the crystal.
        offset: where the program begins in the flash, behind a bootloader that is not there; for an ELF 0 means
            where its first section is.
        supply: pin of the ADC that measures the supply voltage by a divider; empty: none does.
        supply_divider: supply voltage over the voltage at that pin.
    """

    flash_kb: Annotated[int, Within(16, 512, unit="KB")] = 128
    ram_kb: Annotated[int, Within(4, 64, unit="KB")] = 20
    crystal_hz: Annotated[int, Within(4_000_000, 16_000_000, unit="Hz")] = 8_000_000
    offset: Annotated[int, Within(0, 512 * 1024)] = 0
    supply: str = ""
    supply_divider: Annotated[float, Within(1, 100)] = 11.0

    def __post_init__(self) -> None:
        check_limits(self)
        with prefixed("supply: "):
            if self.supply and analog_channel(ChipPin.of(self.supply)) is None:
                raise InputError(f"{self.supply}: is no input of the ADC: PA0 to PA7, PB0, PB1 or PC0 to PC5")

    def check(self, robot: Robot) -> None:
        """Raise InputError unless each axis has its pins, and no two wires are at one pin."""
        wiring_of(robot)


TABLE, SECOND_TABLE = "pins", "second_pins"
"""Tables of a joint: the pins of its driver and switches, and those of its second motor's."""


def wiring_of(robot: Robot) -> dict[str, JointPins]:
    """Return the pins of each axis, by its name.

    Raises:
        InputError: an axis has no pins, or two wires are at one pin; its messages are all of these.
    """
    findings, wiring, used = Findings(), dict[str, JointPins](), dict[int, str]()
    for joint in robot.joints:
        names = {TABLE: joint.name}
        if joint.second_motor is not None:
            names[SECOND_TABLE] = joint.second_motor.name
        elif SECOND_TABLE in joint.tables:
            findings.add(f"joints.{joint.name}.{SECOND_TABLE}: the joint has no second motor")
        for key, axis in names.items():
            if key in joint.tables:
                wiring[axis] = joint.tables[key]
            else:
                findings.add(
                    f'joints.{joint.name}.{key}: is missing: the STM32F103\'s pins, such as step = "PA0", dir = "PA1"'
                )
    for place, pin in _wires(wiring):
        if (other := used.setdefault(pin.number, place)) != place:
            findings.add(f"{place}: {pin.name} is that of {other} already")
    findings.raise_first()
    return wiring


def _wires(wiring: Mapping[str, JointPins]) -> Iterator[tuple[str, ChipPin]]:
    """Yield the pins that one wire each may use; an enable or an emergency stop may be that of several axes."""
    for axis, pins in wiring.items():
        for key in (*OUTPUTS, *INPUTS):
            if key not in _SHARED and (pin := pins.pin(key)) is not None:
                yield f"{axis}'s {key}", pin
    for key in _SHARED:
        shared = {pin.number: pin for pins in wiring.values() if (pin := pins.pin(key)) is not None}
        for pin in shared.values():
            yield f"the axes' {key}", pin


_SHARED: Final = ("enable", "estop")
