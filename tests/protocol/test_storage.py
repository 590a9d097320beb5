"""The robot's name as a board stores it."""

import pytest

from steptwin.protocol.dictionary import TEXT_BYTES_MAX, ObjectDictionary
from steptwin.protocol.od import ROBOT_NAME
from steptwin.protocol.storage import NO_NAME, checksum, stored_name


@pytest.mark.parametrize(
    ("name", "stored"),
    [
        ("lab-scara", "lab-scara"),
        ("größe", r"gr\xf6\xdfe"),
        ("a\nb", r"a\nb"),
        ("\ud800", r"\ud800"),
        ("x" * 99, "x" * 64),
    ],
)
def test_a_board_takes_every_name(name: str, stored: str) -> None:
    assert stored_name(name) == stored
    assert len(stored) <= TEXT_BYTES_MAX
    dictionary = ObjectDictionary(0x10)
    dictionary.write(ROBOT_NAME, stored.encode("ascii"))
    assert dictionary.text(ROBOT_NAME) == stored


def test_the_checksum_is_the_crc_32_of_ethernet() -> None:
    """Check value of the CRC catalogue, for the text 123456789."""
    assert checksum("123456789") == 0xCBF4_3926
    assert checksum("") == NO_NAME
