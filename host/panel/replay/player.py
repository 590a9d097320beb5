"""Play a replay: a time of the motion that runs, faster or slower than it did, and steps."""

from collections.abc import Sequence

from steptwin.host.panel.replay.model import Edge, Replay


class Player:
    """The time that a page shows of one run, or of two side by side.

    Attributes:
        t_s: the time, in that of the motion.
        playing: whether it runs.
        speed: seconds of the motion in a second.
    """

    def __init__(self, replays: Sequence[Replay]) -> None:
        self._replays = replays
        self.first_s: float = min(replay.time_s(replay.shown.from_counts) for replay in replays)
        self.last_s: float = max(replay.time_s(replay.shown.to_counts) for replay in replays)
        self.t_s: float = 0.0
        self.playing: bool = False
        self.speed: float = 1.0

    def play(self) -> None:
        """Let the time run; from the motion's start if it is at its end."""
        if self.t_s >= self.last_s:
            self.t_s = 0.0
        self.playing = True

    def pause(self) -> None:
        """Let the time stand."""
        self.playing = False

    def advance(self, dt_s: float) -> bool:
        """Let some time pass in the world; return whether the time shown has changed. At the end it stands."""
        if not self.playing:
            return False
        self.t_s = min(self.t_s + dt_s * self.speed, self.last_s)
        self.playing = self.t_s < self.last_s
        return True

    def seek(self, t_s: float) -> None:
        """Stand at a time; one outside the shown part is reached only by steps."""
        self.pause()
        self.t_s = min(max(t_s, self.first_s), self.last_s)

    def step(self, way: int, run: int = 0, axis: str | None = None) -> Edge | None:
        """Go to the next edge of a run's pins, or to the one before (way -1), and return it; None if there is none."""
        self.pause()
        replay = self._replays[run]
        find = replay.edge_before if way < 0 else replay.edge_after
        edge = find(replay.counts_at(self.t_s), axis)
        if edge is not None:
            self.t_s = replay.time_s(edge.counts)
        return edge

    def step_to_mark(self, way: int, run: int = 0) -> None:
        """Go to the next mark of a run, or to the one before (way -1), if there is one."""
        self.pause()
        replay = self._replays[run]
        now = replay.counts_at(self.t_s)
        instants = [mark.counts for mark in replay.marks if (mark.counts - now) * way > 0]
        if instants:
            self.t_s = replay.time_s(min(instants, key=lambda counts: abs(counts - now)))
