"""A running image as a test or a script sees it: its USARTs, pins, variables and memory; snapshots of its chip."""

from collections.abc import Callable
from typing import Final, NamedTuple

from steptwin.features.stm32.chip import cells as c
from steptwin.features.stm32.chip.engine import ChipSnapshot, Stm32Chip
from steptwin.features.stm32.firmware import ImageFirmware
from steptwin.features.stm32.section import ChipPin
from steptwin.host.common.errors import InputError
from steptwin.protocol.frame import Frame
from steptwin.protocol.timer import COUNTS_PER_SECOND

STEP_S: Final = 0.001
"""How often a USART is looked at for a text."""
_SHOWN_CHARS: Final = 200


class ExpectationError(AssertionError):
    """A USART has not sent an expected text in time."""


class PinLevel(NamedTuple):
    """A level of a pin from an instant on, in seconds since power-up."""

    t_s: float
    level: int


class ImageSnapshot(NamedTuple):
    """A chip's state, and how much of each USART's text had been read."""

    chip: ChipSnapshot
    read: tuple[int, ...]


class Usart:
    """One of the chip's USARTs from the other side of its wires."""

    def __init__(self, tools: "ImageTools", number: int) -> None:
        """Take the USART with this number, from 0."""
        self._tools, self._number = tools, number
        self.read_bytes: int = 0
        """Bytes that have been read by `read` and `expect`."""

    def write(self, text: str | bytes) -> None:
        """Let text arrive at the USART, a byte after the other at its bit rate."""
        self._tools.chip.give(self._number, text.encode() if isinstance(text, str) else text)

    @property
    def text(self) -> str:
        """All that it has sent, at most the last 64 KiB."""
        return self._tools.chip.sent(self._number).decode("utf-8", errors="replace")

    def read(self) -> str:
        """Return what it has sent since the last `read` or `expect`."""
        unread = self._unread()
        self.read_bytes = self._tools.chip.sent_count(self._number)
        return unread.decode("utf-8", errors="replace")

    def expect(self, text: str, within_s: float = 1.0) -> str:
        """Let time pass until it has sent a text; return what it has sent up to the text's end.

        It looks at what has been sent since the last `read` or `expect`.

        Raises:
            ExpectationError: it has not sent the text within the time.
        """
        wanted, end_s = text.encode(), self._tools.now_s + within_s
        while (place := (unread := self._unread()).find(wanted)) < 0:
            left_s = end_s - self._tools.now_s
            if left_s <= 0:
                sent = unread.decode("utf-8", errors="replace")
                raise ExpectationError(
                    f"USART{self._number + 1} has not sent {text!r} within {within_s:g} s, but {sent[-_SHOWN_CHARS:]!r}"
                )
            self._tools.wait(min(left_s, STEP_S))
        found = unread[: place + len(wanted)]
        self.read_bytes = self._tools.chip.sent_count(self._number) - len(unread) + len(found)
        return found.decode("utf-8", errors="replace")

    def _unread(self) -> bytes:
        if self._tools.firmware.chip is None:
            return b""
        count = self._tools.chip.sent_count(self._number)
        self.read_bytes = self.read_bytes if self.read_bytes <= count else 0  # fewer after a power-up
        count -= self.read_bytes
        return self._tools.chip.sent(self._number)[-count:] if count > 0 else b""


class ImagePin:
    """A pin of the chip: its level, and its levels since power-up."""

    def __init__(self, tools: "ImageTools", number: int) -> None:
        self._tools, self._number = tools, number

    @property
    def level(self) -> int:
        """The present level."""
        return self._tools.chip.level(self._number)

    @property
    def history(self) -> list[PinLevel]:
        """Its changes since power-up, in order of time; the oldest are dropped beyond a million edges of all pins."""
        counts, levels = self._tools.firmware.edges.of(self._number)
        return [
            PinLevel(at / COUNTS_PER_SECOND, level) for at, level in zip(counts.tolist(), levels.tolist(), strict=True)
        ]


class Variable:
    """A variable of the image, by its symbol in the ELF."""

    def __init__(self, tools: "ImageTools", name: str) -> None:
        """Find a variable; raise InputError for a name that is unknown or not unique."""
        self._tools, self.name = tools, name
        self.address: int
        self.size_bytes: int
        self.address, self.size_bytes = tools.firmware.image.variable(name)

    @property
    def content(self) -> bytes:
        """Its bytes."""
        return self._tools.read_memory(self.address, self.size_bytes)

    @content.setter
    def content(self, content: bytes) -> None:
        if len(content) != self.size_bytes:
            raise InputError(f"{self.name}: has {self.size_bytes} bytes, not {len(content)}")
        self._tools.write_memory(self.address, content)

    @property
    def value(self) -> int:
        """Its value as an unsigned integer."""
        return int.from_bytes(self._integer(), "little")

    @value.setter
    def value(self, value: int) -> None:
        bits = 8 * len(self._integer())
        if not -(1 << bits - 1) <= value < 1 << bits:
            raise InputError(f"{self.name}: {value} does not fit into its {bits} bits")
        self.content = (value & (1 << bits) - 1).to_bytes(self.size_bytes, "little")

    @property
    def signed(self) -> int:
        """Its value as a signed integer."""
        return int.from_bytes(self._integer(), "little", signed=True)

    def _integer(self) -> bytes:
        if self.size_bytes not in (1, 2, 4, 8):
            raise InputError(f"{self.name}: has {self.size_bytes} bytes and is no integer: use its content")
        return self.content


class ImageTools:
    """An image that runs on an emulated board.

    Attributes:
        wait: lets time pass, in seconds.
        send_frame: sends a frame as the host.
        usarts: its USARTs.
    """

    def __init__(
        self,
        running: Callable[[], ImageFirmware],
        wait: Callable[[float], None],
        send_frame: Callable[[Frame], None],
    ) -> None:
        """Look at what a board runs now, which is another firmware after each power-up."""
        self._running, self.wait, self.send_frame = running, wait, send_frame
        self.usarts: tuple[Usart, ...] = tuple(Usart(self, number) for number in range(c.USARTS))

    @property
    def firmware(self) -> ImageFirmware:
        """The firmware since the last power-up."""
        return self._running()

    @property
    def chip(self) -> Stm32Chip:
        """The chip since the last power-up.

        Raises:
            InputError: the board has no power.
        """
        if self.firmware.chip is None:
            raise InputError("the board has no power now: its chip has no state; let the fault end before, by for_ms")
        return self.firmware.chip

    @property
    def now_s(self) -> float:
        """The instant that the chip has reached, in seconds since the machine's power-up."""
        return self.firmware.motion.reached_counts / COUNTS_PER_SECOND

    @property
    def uart(self) -> Usart:
        """USART1."""
        return self.usarts[0]

    def pin(self, name: str) -> ImagePin:
        """Return a pin such as PB5; raise InputError if the chip has none of this name."""
        return ImagePin(self, ChipPin.of(name).number)

    def symbol(self, name: str) -> Variable:
        """Return a variable of the image; raise InputError for a name that is unknown or not unique."""
        return Variable(self, name)

    def read_memory(self, address: int, size_bytes: int) -> bytes:
        """Return what stands in RAM or flash; raise InputError if there is neither."""
        content = self.chip.memory(address, size_bytes)
        if content is None:
            raise InputError(f"0x{address:08X}: {size_bytes} bytes there are neither RAM nor flash")
        return content

    def write_memory(self, address: int, content: bytes) -> None:
        """Change RAM or flash, as a debugger does; raise InputError if there is neither."""
        if not self.chip.set_memory(address, content):
            raise InputError(f"0x{address:08X}: {len(content)} bytes there are neither RAM nor flash")

    def snapshot(self) -> ImageSnapshot:
        """Return the chip's present state."""
        return ImageSnapshot(self.firmware.snapshot(), tuple(each.read_bytes for each in self.usarts))

    def restore(self, snapshot: ImageSnapshot) -> None:
        """Return the chip to a state, now: time, drivers, motors and switches stay as they are."""
        self.firmware.restore(snapshot.chip)
        for usart, read_bytes in zip(self.usarts, snapshot.read, strict=True):
            usart.read_bytes = read_bytes
