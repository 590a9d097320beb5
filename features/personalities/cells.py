"""The cells behind the objects of a personality: a firmware object, a constant, a store or a refusal."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from steptwin.features.personalities.file import Behind
from steptwin.features.personalities.units import DriveUnits
from steptwin.protocol import od
from steptwin.protocol.dictionary import UserUnit
from steptwin.protocol.entry import QUANTITIES, Entry, EntryUnit
from steptwin.protocol.object_view import FirmwareCell
from steptwin.protocol.sdo_frames import AbortCode, SdoAbortError

UNIT_WORDS: Final = {
    od.address_of(0x60A8): EntryUnit.POSITION,
    od.address_of(0x60A9): EntryUnit.VELOCITY,
    od.address_of(0x60AA): EntryUnit.ACCELERATION,
}
"""Role of the unit that an entry's word names."""
_GEAR: Final = od.GEAR_MOTOR_REVOLUTIONS, od.GEAR_SHAFT_REVOLUTIONS


@dataclass(frozen=True, slots=True)
class PersonalityRow:
    """One entry of a personality.

    Attributes:
        entry: the entry, as the bus sees it.
        behind: what stands behind it.
        firmware: address of the firmware's object behind it; None for others.
        codes: the firmware's values for some of the bus.
        source: where its values come from.
    """

    entry: Entry
    behind: Behind
    firmware: int | None
    codes: Mapping[int, int]
    source: str


class StoreCell:
    """A value that is only stored, or a constant; a write does nothing else."""

    plain: Final = False

    def __init__(self, entry: Entry) -> None:
        self._entry = entry
        self.value = 0

    def get(self) -> int:
        """Return the value."""
        return self.value

    def check(self, value: int) -> None:
        """Raise SdoAbortError for a value that the entry does not take."""
        entry = self._entry
        low = entry.data_type.low if entry.low is None else entry.low
        high = entry.data_type.high if entry.high is None else entry.high
        if not low <= value <= high:
            raise SdoAbortError(AbortCode.VALUE_TOO_HIGH if value > high else AbortCode.VALUE_TOO_LOW)
        if entry.values is not None and value not in entry.values:
            raise SdoAbortError(AbortCode.VALUE_RANGE)

    def put(self, value: int) -> None:
        """Store a value that the entry takes."""
        self.check(value)
        self.value = value

    def reset(self, node_id: int, stored: Mapping[int, int]) -> None:
        """Return to the default."""
        del stored
        assert isinstance(self._entry.default, int)
        self.value = self._entry.default + (node_id if self._entry.plus_node_id else 0)


class RefusingCell(StoreCell):
    """A value that can be read; each write is refused."""

    def __init__(self, entry: Entry, abort: AbortCode) -> None:
        super().__init__(entry)
        self._abort = abort

    def put(self, value: int) -> None:
        """Refuse the value."""
        self.check(value)
        raise SdoAbortError(self._abort)


class FirmwareObject(StoreCell):
    """A value of the firmware, with the range, the default and the codes of the personality.

    `value` is the last number that the bus has written. The bus reads it as long as the firmware has what came of it.
    """

    def __init__(self, row: PersonalityRow, firmware: FirmwareCell) -> None:
        super().__init__(row.entry)
        self._address = row.firmware
        self._codes = row.codes
        self.firmware = firmware
        self._written: int | None = None
        """Value that the firmware has got for `value`; None if it has got none."""

    def to_firmware(self, value: int) -> int:
        """Return the firmware's value for one of the bus."""
        return self._codes.get(value, value)

    def to_bus(self, value: int) -> int:
        """Return the bus's value for one of the firmware."""
        return value

    def get(self) -> int:
        """Return the present value."""
        present = self.firmware.present()
        if present == self._written:
            return self.value
        kind = self._entry.data_type
        return max(kind.low, min(self.to_bus(present), kind.high))

    def put(self, value: int) -> None:
        """Check a value and let the firmware act on it."""
        self.check(value)
        self._take(value, self.to_firmware(value))

    def _take(self, value: int, written: int) -> None:
        self.firmware.command(written)
        self.value, self._written = value, written

    def reset(self, node_id: int, stored: Mapping[int, int]) -> None:
        """Return to the default, or to what the firmware has stored."""
        self._written = None
        if self._address not in stored:
            super().reset(node_id, stored)
            self._written = self.firmware.value = self.to_firmware(self.value)


class QuantityObject(FirmwareObject):
    """A position, velocity, acceleration or jerk in the drive's own unit.

    A number beyond the firmware's range acts as the end of that range. The ends of the entry's type keep their meaning
    "off". If the unit changes, the number stays, and the firmware gets its new value.
    """

    def __init__(self, row: PersonalityRow, firmware: FirmwareCell) -> None:
        super().__init__(row, firmware)
        self.role = row.entry.unit
        self._unit = UserUnit()

    def to_firmware(self, value: int) -> int:
        """Return the nearest number of wire units within the firmware's range."""
        return max(self.firmware.low, min(self._unit.to_wire(value), self.firmware.high))

    def to_bus(self, value: int) -> int:
        """Return the nearest number of the drive's units."""
        return self._unit.to_user(value)

    def take_unit(self, unit: UserUnit) -> None:
        """Use another unit: a number that was written stays as it is."""
        self._unit = unit
        if self._written is None:
            return
        written = self.to_firmware(self.value)
        if self._address == od.MAX_PROFILE_VELOCITY:  # the step configuration has it, too
            self.firmware.command(written)
        self._written = self.firmware.value = written


class UnitCells:
    """The units of one node, and the quantities that have them."""

    def __init__(self, increments: int, may_change: FirmwareCell) -> None:
        """Begin without words; `may_change` refuses a command in states in which units cannot change."""
        self.units = DriveUnits({}, (1, 1), increments)
        self.quantities: list[QuantityObject] = []
        self._may_change = may_change

    def set(self, address: int, value: int) -> None:
        """Take the value of an entry of the units as it is after a reset."""
        self.units = self._with(address, value)
        self._rescale()

    def change(self, address: int, value: int) -> None:
        """Change a unit, if it is known and the drive is not enabled."""
        try:
            changed = self._with(address, value)
            for role in QUANTITIES:
                if changed.unit(role).wire <= 0:
                    raise ValueError
        except (ValueError, ZeroDivisionError):
            raise SdoAbortError(AbortCode.VALUE_RANGE) from None
        self._may_change.command(self._may_change.value)
        self.units = changed
        self._rescale()

    def _with(self, address: int, value: int) -> DriveUnits:
        words, gear = dict(self.units.words), list(self.units.gear)
        if address in UNIT_WORDS:
            words[UNIT_WORDS[address]] = value
        else:
            gear[_GEAR.index(address)] = value
        return DriveUnits(words, (gear[0], gear[1]), self.units.increments)

    def _rescale(self) -> None:
        if EntryUnit.POSITION not in self.units.words:
            return
        for each in self.quantities:
            each.take_unit(self.units.unit(each.role))


UNIT_ENTRIES: Final = (*UNIT_WORDS, *_GEAR)
"""Entries that the units of a node consist of."""


class UnitCell(StoreCell):
    """An entry of the units (60A8h to 60AAh, 6091h)."""

    def __init__(self, address: int, entry: Entry, units: UnitCells) -> None:
        super().__init__(entry)
        self._address = address
        self._units = units

    def put(self, value: int) -> None:
        """Change the unit."""
        self.check(value)
        self._units.change(self._address, value)
        self.value = value

    def reset(self, node_id: int, stored: Mapping[int, int]) -> None:
        """Return to the default unit."""
        super().reset(node_id, stored)
        self._units.set(self._address, self.value)
