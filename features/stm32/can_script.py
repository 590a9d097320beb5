"""CAN frames for an image: those of a script, in the format of `candump -L`, and those of a test."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Final

from steptwin.protocol.frame import Frame
from steptwin.protocol.timer import COUNTS_PER_SECOND

if TYPE_CHECKING:
    from steptwin.emulator.simulation import Simulation
    from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard

_STEP_S: Final = 0.0001
"""How often the bus is looked at for a frame."""
_SHOWN: Final = 5


class CanScript:
    """Frames that the host sends, each at its instant since power-up, as a participant of a simulation."""

    def __init__(self, simulation: "Simulation", frames: Iterable[tuple[int, Frame]]) -> None:
        """Take frames with their instants in counts, in order of time."""
        self._simulation = simulation
        self._frames = list(frames)[::-1]

    @property
    def next_due_counts(self) -> int | None:
        """Instant of the next frame."""
        return self._frames[-1][0] if self._frames else None

    def step(self, now_counts: int) -> None:
        """Send the frames that are due."""
        while self._frames and self._frames[-1][0] <= now_counts:
            self._simulation.host.send(self._frames.pop()[1], now_counts)


class FrameExpectationError(AssertionError):
    """An image has not sent an expected frame in time."""


class CanPort:
    """The other end of an image's CAN bus, for a test with the fixture `steptwin_board`."""

    def __init__(self, board: "EmbeddedBoard") -> None:
        """Take a board; `expect` looks at its frames from now on."""
        self._board = board
        self._seen = len(board.bus_log)

    def send(self, cob_id: int, data: bytes = b"") -> None:
        """Send a frame, and let time pass until the bus is idle."""
        self._board.network.send_message(cob_id, data)

    def expect(self, cob_id: int, within_s: float = 1.0) -> bytes:
        """Let time pass until a frame with an identifier is on the bus; return its data.

        It looks at the frames behind the last one that was expected.

        Raises:
            FrameExpectationError: there is none within the time.
        """
        end_s = self._board.now_s() + within_s
        while True:
            frames = [frame for _, frame in self._board.bus_log[self._seen :]]
            for number, frame in enumerate(frames):
                if frame.cob_id == cob_id:
                    self._seen += number + 1
                    return frame.data
            if (left_s := end_s - self._board.now_s()) <= 0:
                seen = ", ".join(f"{frame.cob_id:03X}#{frame.data.hex().upper()}" for frame in frames[-_SHOWN:])
                raise FrameExpectationError(
                    f"no frame {cob_id:03X} within {within_s:g} s, but {seen or 'no other one either'}"
                )
            self._board.wait(min(left_s, _STEP_S))


def frame_texts(frames: Iterable[tuple[int, Frame]]) -> list[dict[str, object]]:
    """Return frames for JSON: instant in seconds, identifier and data in hexadecimal digits."""
    return [
        {"t_s": counts / COUNTS_PER_SECOND, "id": f"{frame.cob_id:03X}", "data": frame.data.hex().upper()}
        for counts, frame in frames
    ]
