"""The table `[stm32]` of a robot file: the chip's memory and crystal, and what its pins are wired to."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Final

from steptwin.host.common.bad_input import unknown
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
    """The pins of one joint's driver and switches, such as PA0, or !PA0 for an inverted one.

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
    """The STM32F103 that drives the robot, for `steptwin run-image`.

    Attributes:
        joints: the pins of each joint, by its name.
        flash_kb: size of the flash: 64 for an STM32F103C8, whose other half mostly works as well.
        ram_kb: size of the RAM.
        crystal_hz: frequency of the crystal.
        offset: where the program begins in the flash, behind a bootloader that is not there; for an ELF 0 means
            where its first section is.
        supply: pin of the ADC that measures the supply voltage by a divider; empty: none does.
        supply_divider: supply voltage over the voltage at that pin.
    """

    joints: Mapping[str, JointPins]
    flash_kb: Annotated[int, Within(16, 512, unit="KB")] = 128
    ram_kb: Annotated[int, Within(4, 64, unit="KB")] = 20
    crystal_hz: Annotated[int, Within(4_000_000, 16_000_000, unit="Hz")] = 8_000_000
    offset: Annotated[int, Within(0, 512 * 1024)] = 0
    supply: str = ""
    supply_divider: Annotated[float, Within(1, 100)] = 11.0

    def __post_init__(self) -> None:
        check_limits(self)
        findings, used = Findings(), dict[int, str]()
        with findings.collecting("supply: "):
            if self.supply and analog_channel(ChipPin.of(self.supply)) is None:
                raise InputError(f"{self.supply}: is no input of the ADC: PA0 to PA7, PB0, PB1 or PC0 to PC5")
        for place, pin in self._pins():
            if (other := used.setdefault(pin.number, place)) != place:
                findings.add(f"joints.{place}: {pin.name} is that of {other} already")
        findings.raise_first()

    def _pins(self) -> Iterator[tuple[str, ChipPin]]:
        """Yield the pins that one wire each may use; an emergency stop may be read for all joints by one."""
        for name, joint in self.joints.items():
            for key in (*OUTPUTS, *INPUTS):
                if key not in ("enable", "estop") and (pin := joint.pin(key)) is not None:
                    yield f"{name}.{key}", pin
        for key in ("enable", "estop"):
            pins = {pin.number: pin for joint in self.joints.values() if (pin := joint.pin(key)) is not None}
            for pin in pins.values():
                yield f"NAME.{key}", pin

    def check(self, robot: Robot) -> None:
        """Raise InputError unless each joint has its pins, and no other."""
        findings = Findings()
        for name in self.joints:
            if name not in robot.axis_names:
                findings.add(str(unknown("stm32.joints: joint", name, robot.axis_names)))
        for name in robot.axis_names:
            if name not in self.joints:
                findings.add(f'stm32.joints.{name}: is missing: its pins, such as step = "PA0", dir = "PA1"')
        findings.raise_first()
