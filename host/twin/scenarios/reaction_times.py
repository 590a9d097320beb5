"""How soon the firmware and the host notice what goes wrong, in ms."""

from typing import Final

from steptwin.host.client.heartbeat import TIMEOUT_MS
from steptwin.host.client.waiting import REPLY_TIMEOUT_S, SILENCE_S
from steptwin.protocol.pvt import QUEUE_DEPTH

TICK_MS: Final = 0.25
"""The firmware sees its inputs, and begins a ramp, with the next servo tick."""
HEARTBEAT_MS: Final = TIMEOUT_MS + TICK_MS
"""A host is lost when its heartbeat has been missing for this long."""
RECORD_MS: Final = 10
"""Longest record of a planned motion."""
QUEUE_MS: Final = (QUEUE_DEPTH + 1) * RECORD_MS + TICK_MS
"""A full queue and the record in execution last so long."""

HOST_NOTICES_MS: Final = 40.0
"""What a host needs to stop the other boards after a fault on one: the inhibit time of its report and two looks of the
host, 10 ms each, and frames that wait for the bus."""
LOST_BOARD_MS: Final = 1000 * SILENCE_S + 100 + HOST_NOTICES_MS
"""Until a host notices that a board is silent, whose last report may be one period of its event timer, 100 ms, old."""
DEAF_BOARD_MS: Final = 1000 * REPLY_TIMEOUT_S + HOST_NOTICES_MS
"""Until a host has stopped the axes that have started because others have not."""
