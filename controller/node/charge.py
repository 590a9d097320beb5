"""Lend the axis to one program at a time: object 2017h (docs/canopen.md, "One program in charge")."""

from typing import Final

from steptwin.protocol.dictionary import ObjectDictionary
from steptwin.protocol.od import CHARGE_FREE, CHARGE_UNWATCHED_MS
from steptwin.protocol.sdo_frames import AbortCode, SdoAbortError

_UNWATCHED_US: Final = 1000 * CHARGE_UNWATCHED_MS


class Charge:
    """The token of the program in charge, until that program gives it back or falls silent."""

    def __init__(self, dictionary: ObjectDictionary) -> None:
        self.token: int = CHARGE_FREE
        """The token of the program in charge; CHARGE_FREE while none is."""
        self._claimed = False
        self.due_us: int | None = None
        """Time of the next call of `poll`; None while no program is in charge."""
        dictionary.bind(self)

    def claim(self, token: int) -> None:
        """Lend the axis to the program with this token, unless another one is in charge."""
        if token == CHARGE_FREE:
            raise SdoAbortError(AbortCode.VALUE_TOO_LOW)
        if self.token not in (CHARGE_FREE, token):
            raise SdoAbortError(AbortCode.DEVICE_STATE)
        self.token, self._claimed = token, True

    def release(self, token: int) -> None:
        """Take the axis back from the program in charge, which has this token."""
        if self.token != token:
            raise SdoAbortError(AbortCode.DEVICE_STATE)
        self.forget()

    def forget(self) -> None:
        """Let the axis be free: the program in charge has released it, was lost, or the node is reset."""
        self.token, self._claimed, self.due_us = CHARGE_FREE, False, None

    def watch_changed(self) -> None:
        """Wait for a monitored heartbeat from now on: a program has changed which ones are.

        One that ends its monitoring and then gives the axis back would else lose it in between, by chance.
        """
        self._claimed |= self.token != CHARGE_FREE

    def settle(self, now_us: int) -> None:
        """Begin to wait for a monitored heartbeat if the call that ends has claimed the axis, or `watch_changed`."""
        if self._claimed:
            self._claimed, self.due_us = False, now_us + _UNWATCHED_US

    def poll(self, now_us: int, *, watched: bool) -> None:
        """Forget the program in charge if no heartbeat is monitored; else look again later."""
        if self.due_us is None or now_us < self.due_us:
            return
        if watched:
            self.due_us = now_us + _UNWATCHED_US
        else:
            self.forget()
