"""Check new values of the COB-ID entries of PDOs and of EMCY (CiA 301, sections 7.3.5 and 7.5.2)."""

from steptwin.protocol.abort import AbortCode, SdoAbortError
from steptwin.protocol.frame import COB_ID_INVALID, COB_ID_MASK

_RESTRICTED = ((0x000, 0x080), (0x101, 0x180), (0x581, 0x5FF), (0x601, 0x67F), (0x6E0, 0x7FF))
"""COB-IDs that CiA 301 keeps for other services (table 40): NMT, SYNC, SDO, heartbeat and others."""


def check_cob_id(old: int, new: int, flags: int = 0) -> None:
    """Check whether a COB-ID entry may change from `old` to `new`.

    The identifier has 11 bits and belongs to no other service; of the bits above it only `flags` and "invalid" may be
    set. The identifier of a valid entry may not change: the entry must be made invalid first.

    Raises:
        SdoAbortError: the value is refused.
    """
    identifier = new & ~(COB_ID_INVALID | flags)
    if identifier > COB_ID_MASK or any(first <= identifier <= last for first, last in _RESTRICTED):
        raise SdoAbortError(AbortCode.VALUE_RANGE)
    if not (old | new) & COB_ID_INVALID and (old ^ new) & COB_ID_MASK:
        raise SdoAbortError(AbortCode.VALUE_RANGE)
