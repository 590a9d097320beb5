"""PVT records and status as bytes, and the verdicts of flow control."""

import pytest

from steptwin.protocol.pvt import PvtRecord, PvtStatus, Verdict, judge
from tests.messages import refusing


def test_verdicts_over_the_whole_circle() -> None:
    """All 256 x 256 pairs: the expected number is taken, up to 128 behind it is old, the rest is a gap."""
    for expected in range(256):
        for sequence in range(256):
            ahead = (sequence - expected) % 256
            verdict = judge(sequence, expected, free=1)
            if ahead == 0:
                assert verdict is Verdict.PUSH
                assert judge(sequence, expected, free=0) is Verdict.FULL
            else:
                assert verdict is (Verdict.GAP if ahead < 128 else Verdict.STALE)


def test_record_bytes() -> None:
    assert PvtRecord(-2, 0x01_0203, 10, 255).encode() == bytes.fromhex("feffff 030201 0a ff")


@pytest.mark.parametrize("displacement", [1 << 23, -(1 << 23) - 1])
def test_record_refuses_values_beyond_its_fields(displacement: int) -> None:
    with pytest.raises(OverflowError):
        PvtRecord(displacement, 0, 1, 0).encode()


def test_status() -> None:
    status = PvtStatus.decode(bytes.fromhex("05 40 80 04 78563412"))
    assert status == (5, 64, 128, 4, 0x12345678)
    with refusing(ValueError):
        PvtStatus.decode(bytes(7))
