"""The robot's name as its axes store it: object 2016h, a visible string of CiA 301, and the CRC-32 of it.

The checksum fits into one SDO answer, so a program that only compares names disturbs no other one's dialogue.
"""

from binascii import crc32
from typing import Final

from steptwin.protocol.dictionary import TEXT_BYTES_MAX

NO_NAME: Final = 0
"""Checksum of an empty name."""


def stored_name(name: str) -> str:
    """Return a robot's name in printable ASCII, up to TEXT_BYTES_MAX: other characters as Python escapes them."""
    printable = name.encode("unicode_escape").decode("ascii")
    return printable[:TEXT_BYTES_MAX]


def checksum(stored: str) -> int:
    """Return the CRC-32 (IEEE 802.3) of a stored name; NO_NAME for an empty one."""
    return crc32(stored.encode("ascii"))
