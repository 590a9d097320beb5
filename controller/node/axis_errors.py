"""The errors of one axis: EMCY frames, error register and error history, joined to the object dictionary.

A fault reset by controlword (CiA 402, bit 7) answers whatever has come until it arrives. A frame that the network held
up would so release an emergency stop that came later. The reset that names a number does not.
"""

from collections.abc import Callable
from functools import partial
from typing import Final

from steptwin.protocol import od
from steptwin.protocol.abort import AbortCode, SdoAbortError
from steptwin.protocol.cia402 import ErrorCode
from steptwin.protocol.dictionary import ObjectDictionary, check_cob_id
from steptwin.protocol.emergency import EmergencyProducer
from steptwin.protocol.entry import DataType
from steptwin.protocol.frame import COB_ID_INVALID, Frame
from steptwin.protocol.heartbeat_consumer import HeartbeatConsumer

_US_PER_MS: Final = 1000


class FaultCount:
    """Number and time of the last fault or emergency stop of one axis."""

    def __init__(self, dictionary: ObjectDictionary, now_us: Callable[[], int], reset: Callable[[], None]) -> None:
        """Count from 0; `reset` is called when a host resets the last fault by its number."""
        self._number = 0
        self._at_us = 0
        self._now_us = now_us
        self._reset = reset
        dictionary.read_hooks[od.FAULT_NUMBER] = lambda: self._number
        dictionary.read_hooks[od.FAULT_AGE_MS] = self._age_ms
        dictionary.write_hooks[od.FAULT_RESET] = self._reset_by_number

    def note(self) -> None:
        """Count a fault or an emergency stop, also one that finds the drive in fault already."""
        self._number = self._number % DataType.UNSIGNED32.high + 1
        self._at_us = self._now_us()

    def _age_ms(self) -> int:
        """Return the age of the last fault, rounded down; the highest value without one."""
        if self._number == 0:
            return DataType.UNSIGNED32.high
        return min((self._now_us() - self._at_us) // _US_PER_MS, DataType.UNSIGNED32.high)

    def _reset_by_number(self, number: int) -> None:
        if number != self._number:
            raise SdoAbortError(AbortCode.DEVICE_STATE)  # another fault has come since
        self._reset()


_PDO_LENGTH_ERRORS: Final = (ErrorCode.PDO_TOO_SHORT, ErrorCode.PDO_TOO_LONG)


class AxisErrors:
    """Reports errors when they occur and resolves them when their cause has gone."""

    def __init__(self, dictionary: ObjectDictionary, heartbeats: HeartbeatConsumer, touch: Callable[[], None]) -> None:
        self.producer = EmergencyProducer()
        self._dictionary = dictionary
        self._heartbeats = heartbeats
        self._touch = touch
        read, write = dictionary.read_hooks, dictionary.write_hooks
        read[od.ERROR_REGISTER] = lambda: self.producer.register
        read[od.ERROR_HISTORY_COUNT] = lambda: len(self.producer.history)
        read[od.EMCYS_LOST] = lambda: min(self.producer.lost, DataType.UNSIGNED32.high)
        for i, address in enumerate(od.ERROR_HISTORY):
            read[address] = partial(self._history, i)
        write[od.ERROR_HISTORY_COUNT] = lambda _: self.producer.history.clear()
        write[od.EMCY_COB_ID] = lambda cob_id: check_cob_id(dictionary.get(od.EMCY_COB_ID), cob_id)
        write[od.EMCY_INHIBIT_TIME] = partial(setattr, self.producer, "inhibit")

    def _history(self, i: int) -> int:
        history = self.producer.history
        return history[i] if i < len(history) else 0

    def reset_communication(self) -> None:
        """Resolve the communication errors, drop the frames that wait, read the inhibit time again."""
        self.producer.inhibit = self._dictionary.get(od.EMCY_INHIBIT_TIME)
        self.producer.reset_communication()

    def report(self, code: ErrorCode, detail: int) -> None:
        """Send an EMCY unless the error is active already."""
        self._touch()
        self.producer.raise_error(code, detail)

    def is_reported(self, code: ErrorCode) -> bool:
        """Return whether an error with this code is active, with any detail."""
        return self.producer.is_active(code)

    def resolved(self, code: ErrorCode, detail: int | None = None) -> None:
        """Resolve an error with one detail, or with all its details."""
        self._resolve(lambda active, of: active is code and detail in (None, of))

    def pdo_received(self, number: int) -> None:
        """Resolve a receive PDO's length error, after a frame of the right length."""
        self._resolve(lambda code, detail: code in _PDO_LENGTH_ERRORS and detail == number + 1)

    def acknowledge_faults(self) -> None:
        """Resolve the drive's errors, those of a lost connection, and the lost heartbeats whose producer has returned.

        Other communication errors are resolved by the frames that prove that communication works again.
        """
        self._resolve(self._is_over)

    def _is_over(self, code: ErrorCode, detail: int) -> bool:
        if code is ErrorCode.HEARTBEAT_LOST:
            return detail not in self._heartbeats.lost
        return code.lost_connection or not code.communication  # the frame of a fault reset ends the others

    def _resolve(self, gone: Callable[[ErrorCode, int], bool]) -> None:
        self._touch()
        self.producer.resolve(gone)

    def poll(self, now_us: int) -> Frame | None:
        """Return the EMCY to send now, if one is due and the EMCY COB-ID (1014h) is valid."""
        payload = self.producer.poll(now_us)
        cob_id = self._dictionary.get(od.EMCY_COB_ID)
        return Frame(cob_id, payload) if payload and not cob_id & COB_ID_INVALID else None
