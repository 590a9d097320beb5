"""Store parameters in flash and restore their defaults: objects 1010h and 1011h (CiA 301, 7.5.2.13 and 7.5.2.14).

A reset of the node or of its communication loads the stored values. "load" erases them: the next reset then loads the
defaults. Entries that a PDO may write are commands, not configuration. They are not stored, because no axis may move
and no output may switch at power-up. The limits of the profile are an exception.

The robot's name (2016h:01, a visible string) is stored, too. Its CRC-32 (2016h:02) fits into one SDO answer, so a
program that compares names does not disturb another program's transfer.
"""

from binascii import crc32
from collections.abc import Callable
from typing import Final, TypeVar

from steptwin.protocol import od
from steptwin.protocol.dictionary import TEXT_BYTES_MAX, FlashPage, ObjectDictionary
from steptwin.protocol.entry import Access, DataType, Entry, Mapping
from steptwin.protocol.objects import ENTRIES
from steptwin.protocol.sdo_frames import AbortCode, SdoAbortError

NO_NAME: Final = 0
"""CRC-32 of an empty name."""
_GROUPS: Final = ((0x1000, 0xFFFF), (0x1000, 0x1FFF), (0x6000, 0x9FFF), (0x2000, 0x5FFF))
"""First and last index of each group that can be stored and restored."""
_Value = TypeVar("_Value", int, str)
_SAVE, _LOAD = (int.from_bytes(word, "little") for word in (b"save", b"load"))
_PROFILE_LIMITS = frozenset((od.PROFILE_VELOCITY, od.END_VELOCITY, od.PROFILE_ACCELERATION, od.PROFILE_DECELERATION))
"""Entries that are stored although a PDO may write them: they cause no motion by themselves."""
_STATES = (od.ERROR_HISTORY_COUNT, od.CHARGE_TOKEN, od.EMERGENCY_STOP, od.GROUP_RATE_Q16, od.GROUP_RATE_HIGHEST_Q16)
_CONFIGURATION = od.CONFIGURATION_DATE, od.CONFIGURATION_TIME
"""Entries that name the configuration (1020h); a change of any other parameter sets them to 0."""
_NO_PARAMETERS = frozenset((*_STATES, *od.STORES, *od.RESTORES))


def stored_name(name: str) -> str:
    """Return a robot's name in printable ASCII, with Python's escapes, cut to TEXT_BYTES_MAX."""
    printable = name.encode("unicode_escape").decode("ascii")
    return printable[:TEXT_BYTES_MAX]


def checksum(stored: str) -> int:
    """Return the CRC-32 (IEEE 802.3) of a stored name; NO_NAME for an empty one."""
    return crc32(stored.encode("ascii"))


class ParameterStorage:
    """Stores a node's parameters in its flash page; `busy` is true while a flash write would disturb the motion."""

    ability: Final = 1
    """Value of 1010h and 1011h: parameters are stored and restored on command, not automatically."""

    def __init__(self, dictionary: ObjectDictionary, page: FlashPage, busy: Callable[[], bool]) -> None:
        self._dictionary = dictionary
        self._page = page
        self._busy = busy
        dictionary.bind(self)
        dictionary.on_write = self._written

    def _written(self, address: int) -> None:
        if address not in _CONFIGURATION and _is_parameter(address, self._dictionary.entries[address]):
            for each in _CONFIGURATION:
                self._dictionary.set(each, 0)

    def save_at(self, address: int, signature: int) -> None:
        """Store the parameters of the group that an entry of 1010h names."""
        self._check(signature, _SAVE)
        first, last = _GROUPS[od.STORES.index(address)]
        for place, entry in ENTRIES.items():
            if not (first <= place >> 8 <= last and _is_parameter(place, entry)):
                continue
            if entry.data_type is DataType.VISIBLE_STRING:
                self._page.texts[place] = self._dictionary.text(place)
            else:
                self._page.values[place] = self._dictionary.get(place)

    def load_at(self, address: int, signature: int) -> None:
        """Erase the stored parameters of the group that an entry of 1011h names."""
        self._check(signature, _LOAD)
        first, last = _GROUPS[od.RESTORES.index(address)]
        self._page.values = _outside(first, last, self._page.values)
        self._page.texts = _outside(first, last, self._page.texts)

    def _check(self, signature: int, expected: int) -> None:
        if signature != expected:
            raise SdoAbortError(AbortCode.NOT_STORED)
        if self._busy():
            raise SdoAbortError(AbortCode.DEVICE_STATE)


def _outside(first: int, last: int, stored: dict[int, _Value]) -> dict[int, _Value]:
    return {address: value for address, value in stored.items() if not first <= address >> 8 <= last}


def _is_parameter(address: int, entry: Entry) -> bool:
    commands = bool(entry.mapping.value & Mapping.RECEIVE.value) and address not in _PROFILE_LIMITS
    return entry.access is Access.READ_WRITE and not commands and address not in _NO_PARAMETERS
