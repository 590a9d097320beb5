"""Count the bits of a CAN frame on the wire, stuff bits included (ISO 11898-1, classical base format).

Fields: SOF 1, identifier 11, RTR 1, IDE 1, r0 1, DLC 4, data 8n, CRC 15; then, unstuffed, CRC delimiter 1, ACK 2,
EOF 7 and intermission 3. After five equal bits a stuff bit of the other value follows; it begins the next run. Tables
give CRC and stuff bits per byte, because every frame of a run is counted here. The CRC is linear: it is the XOR of the
CRCs of the single bytes with zeros in place of the other bytes.
"""

from typing import Final, TypeAlias

from steptwin.protocol.frame import COB_ID_MASK, REMOTE, Frame

UNSTUFFED_TAIL_BITS: Final = 13
"""Bits from the end of the CRC to the end of the intermission."""
INTERMISSION_BITS: Final = 3
VALID_BEFORE_END_BITS: Final = INTERMISSION_BITS + 1
"""For a receiver a frame is valid at the last but one bit of EOF (ISO 11898-1)."""
_CRC_POLYNOMIAL: Final = 0x4599
_RUN_LENGTH: Final = 5
_HEADER_BITS: Final = 19
_DATA_BYTES_MAX: Final = 8

# A stuffing state is 4 * last bit + length of its run - 1; a run of five is not a state: its stuff bit follows at once.
_RUNS_PER_LEVEL: Final = 4


def _stuff(state: int, value: int, width: int) -> tuple[int, int]:
    """Process the `width` bits of a value, most significant first; return the new state and the stuff bits."""
    last, run = state // _RUNS_PER_LEVEL, state % _RUNS_PER_LEVEL + 1
    stuffed = 0
    for position in range(width - 1, -1, -1):
        bit = value >> position & 1
        run = run + 1 if bit == last else 1
        last = bit
        if run == _RUN_LENGTH:
            stuffed += 1
            last, run = 1 - last, 1
    return last * _RUNS_PER_LEVEL + run - 1, stuffed


def _crc_after_zeros(crc: int, zeros: int) -> int:
    """Return the CRC after `zeros` further zero bits."""
    for _ in range(zeros):
        crc = (crc << 1 ^ (_CRC_POLYNOMIAL if crc & 0x4000 else 0)) & 0x7FFF
    return crc


def _crc_tables() -> tuple[tuple[int, ...], ...]:
    tables = [tuple(_crc_after_zeros(byte << 7, 8) for byte in range(256))]
    for _ in range(_DATA_BYTES_MAX - 1):
        tables.append(tuple(_crc_after_zeros(crc, 8) for crc in tables[-1]))
    return tuple(reversed(tables))


_CRC_TABLES: Final = _crc_tables()
"""Contribution of each byte value to the CRC: one table for each of the eight bytes, in the order of sending."""

_Row: TypeAlias = "list[tuple[_Row, int]]"
"""Row of one stuffing state: for each following value, the row of the next state and the number of stuff bits.

The first 256 places are for values of 8 bits; the places from _SEVEN_BITS on are for values of 7 bits.
"""
_SEVEN_BITS: Final = 256


def _rows() -> list[_Row]:
    rows: list[_Row] = [[] for _ in range(2 * _RUNS_PER_LEVEL)]
    for state, row in enumerate(rows):
        for width in (8, 7):
            passed = (_stuff(state, value, width) for value in range(1 << width))
            row += [(rows[after], stuffed) for after, stuffed in passed]
    return rows


_ROWS: Final = _rows()
_Header: TypeAlias = "tuple[int, tuple[tuple[int, ...], ...], _Row, int]"
_headers: Final[dict[int, _Header]] = {}
"""Cache of headers, by identifier and length."""


def _header(cob_id: int, length: int) -> _Header:
    """Return the header's (SOF to DLC) effect on the rest of the frame.

    The parts are the header's contribution to the CRC, the CRC tables of the following bytes, the row of the stuffing
    state after the header, and the number of its stuff bits.
    """
    bits = (cob_id & COB_ID_MASK) << 7 | bool(cob_id & REMOTE) << 6 | length
    crc = 0
    for position in range(_HEADER_BITS - 1, -1, -1):
        crc = _crc_after_zeros(crc ^ (bits >> position & 1) << 14, 1)
    # SOF is a 0 and the first bit of a run: the state after it is 0. Then follow the other 18 bits.
    state, stuffed = _stuff(0, bits, _HEADER_BITS - 1)
    return _crc_after_zeros(crc, 8 * length), _CRC_TABLES[_DATA_BYTES_MAX - length :], _ROWS[state], stuffed


def frame_bits(frame: Frame) -> int:
    """Return the frame's length in bits from SOF to the end of the intermission: 47 + 8n + stuff bits."""
    cob_id, data = frame
    length = len(data)
    begins = cob_id << 4 | length
    if begins not in _headers:
        _headers[begins] = _header(cob_id, length)
    crc, crc_tables, row, stuffed = _headers[begins]
    for byte, crc_of in zip(data, crc_tables):  # noqa: B905  (equal lengths; the check costs time)
        crc ^= crc_of[byte]
        row, more = row[byte]
        stuffed += more
    row, high = row[_SEVEN_BITS + (crc >> 8)]
    low = row[crc & 0xFF][1]
    payload = _HEADER_BITS + 8 * length + 15
    return payload + stuffed + high + low + UNSTUFFED_TAIL_BITS
