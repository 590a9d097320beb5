"""Check how far the crystals of a robot's boards are off, and tell it in reports."""

from collections.abc import Sequence
from typing import Any

from steptwin.emulator.local_clock import CRYSTAL_PPM_MAX
from steptwin.host.common.errors import InputError


def read_crystals(text: str) -> list[int]:
    """Return the parts per million of each board from a text such as `100,-100`; raise InputError for another form."""
    try:
        return [int(word) for word in text.split(",")]
    except ValueError:
        raise InputError(f"crystal_ppm={text}: is not a whole number of ppm for each board, as in 100,-100") from None


def check_crystals(crystals_ppm: Sequence[int], boards: int, *, motors: bool) -> None:
    """Raise InputError unless the crystals are in range, one for each board, and no motors turn with those that drift.

    Args:
        crystals_ppm: how fast each board's crystal is, in parts per million; empty: all are exact.
        boards: number of boards.
        motors: True if motors turn with the boards.
    """
    if not any(crystals_ppm) and len(crystals_ppm) in (0, boards):
        return
    given = ",".join(map(str, crystals_ppm))
    for ppm in crystals_ppm:
        if abs(ppm) > CRYSTAL_PPM_MAX:
            nearest = CRYSTAL_PPM_MAX if ppm > 0 else -CRYSTAL_PPM_MAX
            limits = f"{ppm} ppm is not from {-CRYSTAL_PPM_MAX} to {CRYSTAL_PPM_MAX}"
            raise InputError(f"crystal_ppm={given}: {limits}; the nearest is {nearest}")
    if len(crystals_ppm) != boards:
        raise InputError(f"crystal_ppm={given}: has {len(crystals_ppm)} numbers, but the boards are {boards}")
    if motors:
        raise InputError(f"crystal_ppm={given}: motors that turn with the board need its exact crystal, 0")


def crystals_document(crystals_ppm: Sequence[int]) -> dict[str, Any]:
    """Return the entry of a report that tells crystals which are off; none where all are exact."""
    return {"crystal_ppm": list(crystals_ppm)} if any(crystals_ppm) else {}
