"""Reserve the axis for one program at a time: object 2017h (docs/protocol.md, "One program in charge")."""

from typing import Final

from steptwin.protocol.dictionary import ObjectDictionary
from steptwin.protocol.od import CHARGE_FREE, CHARGE_UNWATCHED_MS
from steptwin.protocol.sdo_frames import AbortCode, SdoAbortError

_UNWATCHED_US: Final = 1000 * CHARGE_UNWATCHED_MS


class Charge:
    """The token of the program in charge, until the program releases it or its heartbeat is lost."""

    def __init__(self, dictionary: ObjectDictionary) -> None:
        self.token: int = CHARGE_FREE
        """Token of the program in charge; CHARGE_FREE if none is."""
        self._claimed = False
        self.due_us: int | None = None
        """Time of the next call of `poll`; None while no program is in charge."""
        dictionary.bind(self)

    def claim(self, token: int) -> None:
        """Reserve the axis for the program with this token; refuse if another one is in charge."""
        if token == CHARGE_FREE:
            raise SdoAbortError(AbortCode.VALUE_TOO_LOW)
        if self.token not in (CHARGE_FREE, token):
            raise SdoAbortError(AbortCode.DEVICE_STATE)
        self.token, self._claimed = token, True

    def release(self, token: int) -> None:
        """Free the axis, if this is the token of the program in charge."""
        if self.token != token:
            raise SdoAbortError(AbortCode.DEVICE_STATE)
        self.forget()

    def forget(self) -> None:
        """Free the axis: the program in charge has released it or was lost, or the node is reset."""
        self.token, self._claimed, self.due_us = CHARGE_FREE, False, None

    def watch_changed(self) -> None:
        """Restart the time in which a heartbeat must be monitored, because a program has changed the monitoring.

        Otherwise a program that ends the monitoring could lose the axis before it releases it.
        """
        self._claimed |= self.token != CHARGE_FREE

    def settle(self, now_us: int) -> None:
        """Start the time in which a heartbeat must be monitored, if this call has claimed the axis or changed it."""
        if self._claimed:
            self._claimed, self.due_us = False, now_us + _UNWATCHED_US

    def poll(self, now_us: int, *, watched: bool) -> None:
        """Free the axis if no heartbeat is monitored; else check again later."""
        if self.due_us is None or now_us < self.due_us:
            return
        if watched:
            self.due_us = now_us + _UNWATCHED_US
        else:
            self.forget()
