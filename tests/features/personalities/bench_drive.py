"""A drive with a personality on the in-process bus: masters' writes, byte by byte, in virtual time."""

from collections.abc import Iterable, Iterator

from steptwin.controller.motion.backend import Kernel
from steptwin.features.personalities.personality import Personality, load_personality
from steptwin.protocol import od
from steptwin.protocol.entry import decode
from tests.controller.bench_board import BenchBoard

MICROSTEPS = 4
"""With so few of them the driver's 15 kHz allow 1125 rpm."""
Write = tuple[int, int]
"""Address and value."""


def at(place: str) -> int:
    """The address of a place such as 6099:01."""
    index, _, subindex = place.partition(":")
    return od.address_of(int(index, 16), int(subindex or "0", 16))


def pdo(
    communication: int, cob_id: int, mapping: Iterable[tuple[str, int]], transmission: int | None
) -> Iterator[Write]:
    """The writes of lely's concise DCF for a PDO: off, type, no entries, the entries, their count, on."""
    mapping = tuple(mapping)
    first = od.address_of(communication + 0x200)
    yield od.address_of(communication, 1), 0x8000_0000 | cob_id
    if transmission is not None:
        yield od.address_of(communication, 2), transmission
    yield first, 0
    for i, (place, bits) in enumerate(mapping, start=1):
        yield first + i, at(place) << 8 | bits
    yield first, len(mapping)
    yield od.address_of(communication, 1), cob_id


class BenchDrive(BenchBoard):
    """One axis, with node id 0x10."""

    def __init__(self, kernel: Kernel, personality: str) -> None:
        self.personality: Personality = load_personality(personality)
        super().__init__(kernel, view=self.personality, microsteps=MICROSTEPS)

    def write_all(self, writes: Iterable[Write]) -> dict[str, str]:
        """Make all writes; return the aborts by place."""
        aborts = {}
        for address, value in writes:
            if code := self.write(address, value):
                aborts[od.place_text(address)] = f"{code:08X}"
        return aborts

    def get(self, place: str) -> int:
        """An entry's value as the bus shows it."""
        address = at(place)
        return decode(self.personality.entries[address].data_type, self.firmware.nodes[0].dictionary.read(address))

    def set(self, place: str, value: int) -> int:
        """Write an entry by SDO; return the abort code, 0 for success."""
        return self.write(at(place), value)

    def word(self, *words: int) -> None:
        """Write controlwords by SDO, one after the other."""
        for word in words:
            assert self.set("6040", word) == 0

    def top_speed(self, ms: int) -> int:
        """Let time pass; return the highest speed in wire units per second that the axis had."""
        motion, top = self.firmware.motion.axes[0], 0
        for _ in range(ms // 10):
            self.wait(10)
            top = max(top, abs(motion.velocity_units_per_s))
        return top
