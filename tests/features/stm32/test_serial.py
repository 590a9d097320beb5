"""SPI and I2C as masters with devices in Python, by RM0008, sections 25 and 26."""

from collections.abc import Callable, Iterator

import pytest

from steptwin.features.stm32.chip import i2c, spi
from steptwin.features.stm32.serial_devices import I2cAt, SerialDevices, SpiAt
from steptwin.host.common.errors import InputError
from tests.features.stm32.conftest import GPIOA, Bench

_SPI1, _I2C1, _DMA, _RAM, _PENDING = 0x40013000, 0x40005400, 0x40020000, 0x20000100, 0xE000E200
_CR1, _CR2, _SR, _DR = (_SPI1 + at for at in (0, 4, 8, 0xC))
_ICR1, _ICR2, _IDR, _SR1, _SR2, _CCR = (_I2C1 + at for at in (0, 4, 0x10, 0x14, 0x18, 0x1C))
_BYTE = 8 * 2
"""Counts of a byte of SPI1 at PCLK2 / 2 = 36 MHz."""
_BIT = 2 * 180 * 2
"""Counts of a bit of I2C1 with CCR = 180: 100 kbit/s."""


class _Doubler:
    """An SPI device that returns twice the byte before, and notes what happens to it."""

    def __init__(self) -> None:
        self.notes: list[str] = []
        self._last = 0

    def select(self) -> None:
        self.notes.append("select")

    def deselect(self) -> None:
        self.notes.append("deselect")

    def transfer(self, word: int) -> int:
        self.notes.append(f"{word:X}")
        answer, self._last = 2 * self._last, word
        return answer


class _Memory:
    """An I2C memory of 256 bytes, which acknowledges at most three bytes in a row."""

    def __init__(self) -> None:
        self.notes: list[str] = []
        self.content = bytearray(range(256))
        self._at: int | None = None
        self._written = 0

    def start(self, *, read: bool) -> bool:
        self.notes.append("read" if read else "write")
        self._written = 0
        if not read:
            self._at = None
        return True

    def write(self, byte: int) -> bool:
        self._written += 1
        if self._at is None:
            self._at = byte
        else:
            self.content[self._at] = byte
            self._at += 1
        return self._written <= 3

    def read(self) -> int:
        assert self._at is not None
        self._at += 1
        return self.content[self._at - 1]

    def stop(self) -> None:
        self.notes.append("stop")


@pytest.fixture
def doubler(bench: Bench) -> _Doubler:
    """Return a device at SPI1 that PA4 selects."""
    device = _Doubler()
    bench.devices = SerialDevices([SpiAt(1, device, "PA4")])
    bench.devices.connect(bench.chip)
    bench.write(GPIOA, 0x44434444)
    bench.write(GPIOA + 0x10, 1 << 4)
    bench.write(_CR1, 0x0344)  # SSM, SSI, SPE, MSTR, PCLK2 / 2
    device.notes.clear()
    return device


def _select(bench: Bench, *, low: bool) -> None:
    bench.write(GPIOA + 0x10, 1 << (20 if low else 4))


# --- SPI


def test_a_byte_takes_8_clocks_and_brings_one_back(bench: Bench, doubler: _Doubler) -> None:
    _select(bench, low=True)
    bench.write(_DR, 0x21)
    assert bench.read(_SR) == spi.TXE | spi.BSY
    bench.run(_BYTE - 1)
    assert bench.read(_SR) & spi.RXNE == 0
    bench.run(1)
    assert (bench.read(_SR), bench.read(_DR), bench.read(_SR)) == (spi.TXE | spi.RXNE, 0, spi.TXE)
    bench.write(_DR, 1)
    bench.run(_BYTE)
    assert bench.read(_DR) == 0x42
    _select(bench, low=False)
    assert doubler.notes == ["select", "21", "1", "deselect"]


def test_a_word_that_is_not_read_is_an_overrun(bench: Bench, doubler: _Doubler) -> None:
    _select(bench, low=True)
    bench.write(_CR2, spi.ERRIE)
    bench.write(_DR, 1)
    bench.write(_DR, 2)
    assert bench.read(_SR) & spi.TXE == 0
    bench.run(2 * _BYTE)
    assert bench.read(_SR) == spi.TXE | spi.RXNE | spi.OVR
    assert bench.read(_PENDING + 4) >> 3 & 1
    bench.read(_DR)
    bench.read(_SR)
    assert bench.read(_SR) == spi.TXE
    assert doubler.notes == ["select", "1", "2"]


def test_a_frame_of_16_bits_and_a_prescaler_take_their_time(bench: Bench, doubler: _Doubler) -> None:
    bench.write(_CR1, 0)
    bench.write(_CR1, 0x0B44 | 2 << 3)
    _select(bench, low=True)
    bench.write(_DR, 0xABCD)
    bench.run(16 * 8 - 1)
    assert bench.read(_SR) & spi.RXNE == 0
    bench.run(1)
    assert bench.read(_SR) & spi.RXNE
    assert doubler.notes == ["select", "ABCD"]


@pytest.mark.usefixtures("doubler")
def test_without_a_selected_device_the_input_is_high(bench: Bench) -> None:
    bench.write(_DR, 0x55)
    bench.run(_BYTE)
    assert bench.read(_DR) == 0xFF


@pytest.mark.usefixtures("doubler")
def test_dma_exchanges_a_block(bench: Bench) -> None:
    _select(bench, low=True)
    bench.write(0x40021014, 1)
    bench.set_memory(_RAM, bytes((1, 2, 3, 4)))
    for channel, control, memory in ((2, 0x81, _RAM + 0x100), (3, 0x91, _RAM)):
        place = _DMA + 8 + 20 * (channel - 1)
        for at, value in ((4, 4), (8, _DR), (12, memory), (0, control)):
            bench.write(place + at, value)
    bench.write(_CR2, 3)
    bench.run(5 * _BYTE)
    assert bench.memory(_RAM + 0x100, 4) == bytes((0, 2, 4, 6))


def test_what_a_device_raises_comes_out(bench: Bench, doubler: _Doubler, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(_word: int) -> int:
        raise ZeroDivisionError

    monkeypatch.setattr(doubler, "transfer", fail)
    _select(bench, low=True)
    bench.write(_DR, 1)
    bench.run(_BYTE)
    with pytest.raises(ZeroDivisionError):
        bench.devices.raise_failure()


# --- I2C


@pytest.fixture
def memory(bench: Bench) -> Iterator[_Memory]:
    """Return a memory at I2C1, address 50h."""
    device = _Memory()
    bench.devices = SerialDevices([I2cAt(1, 0x50, device)])
    bench.devices.connect(bench.chip)
    bench.write(_ICR2, 36)
    bench.write(_CCR, 180)
    bench.write(_ICR1, 1)
    yield device
    assert bench.read(_SR2) == 0


def _until(bench: Bench, flag: int, counts: int = 20 * _BIT) -> int:
    """Let time pass until a flag of SR1 is set; return the counts."""
    begin = bench.chip.now_counts
    while not bench.read(_SR1) & flag:
        assert bench.chip.now_counts - begin < counts, f"{bench.read(_SR1):X}"
        bench.run(1 if bench.chip.now_counts - begin > counts else 36)
    return bench.chip.now_counts - begin


def _address(bench: Bench, byte: int, control: int = 0) -> None:
    bench.write(_ICR1, i2c.START_BIT | control | 1)
    assert _until(bench, i2c.SB) == _BIT
    bench.write(_IDR, byte)
    assert _until(bench, i2c.ADDR) == 9 * _BIT


def _write(bench: Bench, *data: int) -> None:
    _address(bench, 0xA0)
    assert bench.read(_SR2) == i2c.MSL | i2c.BUSY | i2c.TRA
    for byte in data:
        _until(bench, i2c.TXE)
        bench.write(_IDR, byte)
    _until(bench, i2c.BTF)


def test_bytes_are_written_and_the_stop_ends_them(bench: Bench, memory: _Memory) -> None:
    _write(bench, 0x10, 0xAA, 0xBB)
    bench.write(_ICR1, i2c.STOP_BIT | 1)
    assert memory.content[0x10:0x13] == bytes((0xAA, 0xBB, 0x12))
    assert memory.notes == ["write", "stop"]


def test_an_address_that_nobody_has_is_not_acknowledged(bench: Bench, memory: _Memory) -> None:
    bench.write(_ICR2, 36 | i2c.ITERREN)
    bench.write(_ICR1, i2c.START_BIT | 1)
    _until(bench, i2c.SB)
    bench.write(_IDR, 0x42)
    _until(bench, i2c.AF)
    assert bench.read(_PENDING + 4) & 1
    bench.write(_ICR1, i2c.STOP_BIT | 1)
    bench.write(_SR1, 0)
    assert bench.read(_SR1) == 0
    assert memory.notes == []


def test_a_byte_that_is_not_acknowledged_is_flagged(bench: Bench, memory: _Memory) -> None:
    _write(bench, 0x10, 1, 2)
    bench.write(_IDR, 3)
    _until(bench, i2c.AF)
    bench.write(_ICR1, i2c.STOP_BIT | 1)
    assert memory.notes == ["write", "stop"]


def _one(bench: Bench) -> list[int]:
    _address(bench, 0xA1)
    bench.read(_SR2)
    bench.write(_ICR1, i2c.STOP_BIT | 1)
    _until(bench, i2c.RXNE)
    return [bench.read(_IDR)]


def _two(bench: Bench) -> list[int]:
    _address(bench, 0xA1, i2c.ACK | i2c.POS)
    bench.read(_SR2)
    bench.write(_ICR1, i2c.POS | 1)
    _until(bench, i2c.BTF)
    bench.write(_ICR1, i2c.STOP_BIT | 1)
    return [bench.read(_IDR), bench.read(_IDR)]


def _many(bench: Bench) -> list[int]:
    """Read five bytes as RM0008 says for more than two: the last three with BTF."""
    _address(bench, 0xA1, i2c.ACK)
    bench.read(_SR2)
    data = []
    for _ in range(2):
        _until(bench, i2c.RXNE)
        data.append(bench.read(_IDR))
    _until(bench, i2c.BTF)
    bench.write(_ICR1, 1)
    data.append(bench.read(_IDR))
    _until(bench, i2c.BTF)
    bench.write(_ICR1, i2c.STOP_BIT | 1)
    data.append(bench.read(_IDR))
    _until(bench, i2c.RXNE)
    return [*data, bench.read(_IDR)]


@pytest.mark.parametrize(("read", "count"), [(_one, 1), (_two, 2), (_many, 5)])
def test_bytes_are_read_by_the_procedures_of_the_manual(
    bench: Bench, memory: _Memory, read: Callable[[Bench], list[int]], count: int
) -> None:
    _write(bench, 0x20)
    assert read(bench) == list(range(0x20, 0x20 + count))
    assert memory.notes == ["write", "read", "stop"]


# --- bad input


def test_a_device_needs_a_place_that_there_is() -> None:
    with pytest.raises(InputError, match=r"^devices: 3: this chip has SPI 1 and 2, and I2C 1 and 2$"):
        SerialDevices([SpiAt(3, _Doubler())])
    with pytest.raises(InputError, match=r"^devices: address 160: is not from 0 to 127, without a read bit$"):
        SerialDevices([I2cAt(1, 0xA0, _Memory())])
    with pytest.raises(InputError, match="'A4': is no pin"):
        SerialDevices([SpiAt(1, _Doubler(), "A4")])
