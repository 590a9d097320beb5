"""SDO frames with a value in them: the standard's bytes, and canopen's own layout of a frame as the other side."""

import pytest
from canopen.sdo.constants import SDO_STRUCT
from hypothesis import given
from hypothesis import strategies as st

from steptwin.protocol.sdo_frames import (
    DOWNLOAD,
    EXPEDITED_BYTES_MAX,
    UPLOAD,
    ObjectValue,
    download_request,
    expedited_value,
    named_address,
    upload_request,
)
from tests.messages import refusing

ADDRESSES = st.integers(0, 0xFFFFFF)
VALUES = st.binary(min_size=1, max_size=4)


@pytest.mark.parametrize(
    ("data", "request_bytes"),
    [
        (b"\x0f\x00", "2b 40 60 00 0f 00 00 00"),
        (b"\x01", "2f 60 60 00 01 00 00 00"),
        (b"\x01\x02\x03\x04", "23 7a 60 00 01 02 03 04"),
        (b"\x01\x02\x03", "27 ff 1f 07 01 02 03 00"),
    ],
)
def test_a_request_that_writes_has_the_bytes_of_the_standard(data: bytes, request_bytes: str) -> None:
    request = bytes.fromhex(request_bytes)
    assert download_request(named_address(request), data) == request


def test_a_request_that_reads_has_the_bytes_of_the_standard() -> None:
    assert upload_request(0x604100) == bytes.fromhex("40 41 60 00 00 00 00 00")


@given(ADDRESSES, VALUES)
def test_what_is_written_is_read_again_as_canopen_lays_it_out(address: int, data: bytes) -> None:
    request = download_request(address, data)
    command, index, subindex = SDO_STRUCT.unpack_from(request)
    assert (command >> 5, index << 8 | subindex, request[4:]) == (1, address, data.ljust(4, b"\0"))
    assert expedited_value(request, DOWNLOAD) == ObjectValue(address, data)
    assert expedited_value(request, UPLOAD) is None


@pytest.mark.parametrize("size", [0, EXPEDITED_BYTES_MAX + 1])
def test_a_value_that_does_not_fit_is_refused(size: int) -> None:
    with refusing(ValueError):
        download_request(0x100800, bytes(size))


@pytest.mark.parametrize(
    ("response", "value"),
    [
        ("43 41 60 00 37 06 00 00", b"\x37\x06\x00\x00"),
        ("4b 41 60 00 37 06 00 00", b"\x37\x06"),
        ("42 41 60 00 37 06 00 00", b"\x37\x06\x00\x00"),  # the size is not told: all four bytes count
        ("41 08 10 00 09 00 00 00", None),  # a value in segments, of nine bytes
        ("80 41 60 00 00 00 02 06", None),  # an abort
        ("60 41 60 00 00 00 00 00", None),  # the answer to a request that writes
        ("4b 41 60 00 37 06 00", None),  # seven bytes
        ("", None),
    ],
)
def test_a_response_tells_its_value_if_it_has_one(response: str, value: bytes | None) -> None:
    found = expedited_value(bytes.fromhex(response), UPLOAD)
    assert found == (None if value is None else ObjectValue(0x604100, value))
