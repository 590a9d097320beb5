"""A difference between a recording and its replay, in words."""

from typing import Any, NamedTuple

from steptwin.protocol.timer import COUNTS_PER_SECOND


class Difference(NamedTuple):
    """Where a replay first leaves its recording.

    Attributes:
        counts: instant in the recording or, where that has nothing, in the replay: since power-up, by a computer's
            clock since the first frame. None for a step by a computer's clock, which tells its own instants.
        where: the frames or the signal that differ, in words.
        recorded: what the recording has there.
        replayed: what the replay has there.
    """

    counts: int | None
    where: str
    recorded: str
    replayed: str

    def __str__(self) -> str:
        at = "" if self.counts is None else f"at {instant(self.counts)}, "
        return f"{at}{self.where}: recorded {self.recorded}, replayed {self.replayed}"

    def to_dict(self) -> dict[str, Any]:
        """Return the difference under the keys of the JSON document."""
        at_s = None if self.counts is None else self.counts / COUNTS_PER_SECOND
        return {"at_s": at_s, "where": self.where, "recorded": self.recorded, "replayed": self.replayed}


NOTHING = "nothing"


def instant(counts: int) -> str:
    """Return an instant in words, to the microsecond."""
    return f"{counts / COUNTS_PER_SECOND:.6f} s"
