"""Devices at the chip's SPI and I2C, written in Python: a test's sensor, driver or memory that answers the firmware."""

from collections.abc import Sequence
from typing import NamedTuple, Protocol

from steptwin.features.stm32.chip import cells as c
from steptwin.features.stm32.chip import outside
from steptwin.features.stm32.chip.engine import Stm32Chip
from steptwin.features.stm32.section import ChipPin
from steptwin.host.common.errors import InputError

_ADDRESS_MAX = 0x7F
_NOTHING = 0xFFFF
"""What a master reads where nobody drives the wire."""


class SpiDevice(Protocol):
    """A device at an SPI."""

    def select(self) -> None:
        """Begin: its select pin has become low."""
        ...

    def deselect(self) -> None:
        """End: its select pin has become high."""
        ...

    def transfer(self, word: int) -> int:
        """Take a byte, or a word of 16 bits, and return the one that goes back at the same time."""
        ...


class I2cDevice(Protocol):
    """A device at an I2C."""

    def start(self, *, read: bool) -> bool:
        """Begin or begin again, to be read or written; return whether it acknowledges its address."""
        ...

    def write(self, byte: int) -> bool:
        """Take a byte; return whether it acknowledges it."""
        ...

    def read(self) -> int:
        """Return the next byte."""
        ...

    def stop(self) -> None:
        """End."""
        ...


class SpiAt(NamedTuple):
    """A device at SPI 1 or 2, selected by the low level of a pin such as PA4; always without one."""

    spi: int
    device: SpiDevice
    select: str = ""


class I2cAt(NamedTuple):
    """A device at I2C 1 or 2, with an address of 7 bits."""

    i2c: int
    address: int
    device: I2cDevice


class SerialDevices:
    """The devices of a chip, from one power-up to the next."""

    def __init__(self, devices: Sequence[SpiAt | I2cAt] = ()) -> None:
        """Take devices; raise InputError for a place that does not exist."""
        for each in devices:
            number = each.spi if isinstance(each, SpiAt) else each.i2c
            if number not in (1, 2):
                raise InputError(f"devices: {number}: this chip has SPI 1 and 2, and I2C 1 and 2")
            if isinstance(each, I2cAt) and not 0 <= each.address <= _ADDRESS_MAX:
                raise InputError(
                    f"devices: address {each.address}: is not from 0 to {_ADDRESS_MAX}, without a read bit"
                )
        self._spis = [each for each in devices if isinstance(each, SpiAt)]
        self._i2cs = [each for each in devices if isinstance(each, I2cAt)]
        self._select_pins = [ChipPin.of(each.select).number if each.select else -1 for each in self._spis]
        self._addressed: dict[int, I2cDevice | None] = {}
        self._failure: BaseException | None = None
        self._chip: Stm32Chip | None = None
        self._answer = outside.ANSWER(self._answered)

    def connect(self, chip: Stm32Chip) -> None:
        """Let the devices answer a chip."""
        self._chip = chip
        chip.cells[c.ANSWERS] = outside.address_of(self._answer)
        for pin in self._select_pins:
            if pin >= 0:
                chip.cells[c.SELECT_MASK + pin // 16] |= 1 << pin % 16

    def raise_failure(self) -> None:
        """Raise what a device has raised."""
        failure, self._failure = self._failure, None
        if failure is not None:
            raise failure

    def _answered(self, question: int, number: int, value: int) -> int:
        try:
            return self._answer_to(question, number, value)
        except BaseException as failure:  # it cannot pass unicorn's frames; `raise_failure` raises it later
            self._failure = failure
            assert self._chip is not None
            self._chip.cells[c.UNTIL] = 0
            return 0

    def _answer_to(self, question: int, number: int, value: int) -> int:
        if question == outside.SELECT:
            for each, pin in zip(self._spis, self._select_pins, strict=True):
                if pin == number:
                    (each.device.deselect if value else each.device.select)()
            return 0
        if question == outside.TRANSFER:
            return self._transferred(number + 1, value)
        if question == outside.START:
            return int(self._started(number, value))
        return self._went_on(question, number, value)

    def _started(self, number: int, value: int) -> bool:
        found = (each.device for each in self._i2cs if each.i2c == number + 1 and each.address == value >> 1)
        device = next(found, None)
        acknowledged = device is not None and device.start(read=bool(value & 1))
        self._addressed[number] = device if acknowledged else None
        return acknowledged

    def _went_on(self, question: int, number: int, value: int) -> int:
        device = self._addressed.get(number)
        if device is None:
            return 0
        if question == outside.WRITE:
            return int(device.write(value))
        if question == outside.READ:
            return device.read()
        self._addressed[number] = None
        device.stop()
        return 0

    def _transferred(self, spi: int, word: int) -> int:
        assert self._chip is not None
        answer = _NOTHING
        for each, pin in zip(self._spis, self._select_pins, strict=True):
            if each.spi == spi and (pin < 0 or not self._chip.level(pin)):
                answer &= each.device.transfer(word)
        return answer
