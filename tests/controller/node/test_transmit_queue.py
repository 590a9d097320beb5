"""The transmit queue: places of each class, services first, the newest process data, pauses."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.controller.node.transmit_queue import (
    BURST_FRAMES_MAX,
    PAUSE_COUNTS,
    PAUSE_COUNTS_MAX,
    PLACES,
    Service,
    TransmitQueue,
)
from steptwin.protocol import od
from steptwin.protocol.dictionary import ObjectDictionary
from steptwin.protocol.entry import Access
from steptwin.protocol.frame import COB_NMT, Frame
from steptwin.protocol.objects import ENTRIES
from steptwin.protocol.sdo_server import SEGMENT_BYTES
from tests.controller.bench_board import BenchBoard
from tests.controller.units import MS
from tests.one_example import one_example

NODES, PDOS = 8, 4
IN_MAILBOX = (Frame(0x7FF, b""),)


def drain(queue: TransmitQueue) -> list[Frame]:
    """Take all frames, through an idle controller."""
    frames = []
    while frame := queue.take((), 0, 10 * PAUSE_COUNTS):
        frames.append(frame)
    return frames


def numbered(cob_id: int, number: int) -> Frame:
    return Frame(cob_id, bytes((number,)))


def test_each_service_of_each_node_has_its_own_places() -> None:
    for service, places in PLACES.items():
        queue = TransmitQueue()
        for number in range(places):
            assert queue.room(0, service)
            assert queue.put(0, service, numbered(0x700, number))
        assert not queue.room(0, service)
        assert not queue.put(0, service, numbered(0x700, places))
        assert queue.put(1, service, numbered(0x701, 0))
        for other in set(Service) - {service}:
            assert queue.put(0, other, Frame(0x702, b""))
        frames = drain(queue)
        assert [frame.data[0] for frame in frames if frame.cob_id == 0x700] == list(range(places))
        assert queue.room(0, service)


def test_the_places_for_sdo_hold_the_longest_block() -> None:
    dictionary = ObjectDictionary(0x10)
    longest = max(
        len(dictionary.read(address)) for address, entry in ENTRIES.items() if entry.access is not Access.WRITE_ONLY
    )
    assert SEGMENT_BYTES * 3 < longest <= SEGMENT_BYTES * PLACES[Service.SDO]


def test_a_newer_pdo_takes_the_place_and_the_turn_of_the_one_that_waits() -> None:
    queue = TransmitQueue()
    assert queue.put_process_data(0, 0, numbered(0x190, 1))
    assert queue.put_process_data(0, 1, numbered(0x290, 2))
    assert not queue.put_process_data(0, 0, numbered(0x190, 3))
    assert queue.put_process_data(1, 0, numbered(0x191, 4))
    assert drain(queue) == [numbered(0x190, 3), numbered(0x290, 2), numbered(0x191, 4)]
    assert queue.put_process_data(0, 0, numbered(0x190, 5))


def test_services_go_ahead_of_process_data_in_the_order_in_which_they_came() -> None:
    queue = TransmitQueue()
    queue.put_process_data(0, 0, Frame(0x190, b""))
    for service, cob_id in ((Service.NMT, 0x710), (Service.SDO, 0x590), (Service.EMCY, 0x090)):
        queue.put(0, service, Frame(cob_id, b""))
    assert [frame.cob_id for frame in drain(queue)] == [0x710, 0x590, 0x090, 0x190]


def test_a_frame_waits_while_a_mailbox_has_its_identifier() -> None:
    queue = TransmitQueue()
    for number in (1, 2):
        queue.put(0, Service.SDO, numbered(0x590, number))
    queue.put_process_data(0, 0, Frame(0x190, b""))
    queue.put_process_data(0, 1, Frame(0x290, b""))
    mailboxes = [numbered(0x590, 0), Frame(0x190, b"old")]
    assert queue.take(mailboxes, 0, 0) == Frame(0x290, b"")
    assert queue.take(mailboxes, 0, 0) is None
    assert queue.take(mailboxes[1:], 0, 0) == numbered(0x590, 1)


def test_a_node_waits_while_any_of_its_frames_does() -> None:
    queue = TransmitQueue()
    queue.put(0, Service.SDO, Frame(0x590, b""))
    queue.put_process_data(1, 0, Frame(0x191, b""))
    assert [queue.waits(node) for node in range(3)] == [True, True, False]
    drain(queue)
    assert not any(queue.waits(node) for node in range(3))


def test_a_burst_is_what_eight_nodes_with_four_tpdos_send_at_once() -> None:
    assert BURST_FRAMES_MAX == 32


def after_a_burst() -> TransmitQueue:
    """A queue that has sent all process data that it may in a row, the last at count 0, and has more."""
    queue = TransmitQueue()
    for number in range(BURST_FRAMES_MAX + 1):
        queue.put_process_data(0, number, numbered(0x190, number))
    for _ in range(BURST_FRAMES_MAX):
        assert queue.take(IN_MAILBOX, 0, 0)
        assert queue.due_counts is None
    return queue


def test_process_data_pause_after_a_burst() -> None:
    queue = after_a_burst()
    assert queue.take(IN_MAILBOX, 0, 1) is None
    idle_since = 5
    assert queue.take((), idle_since, idle_since) is None
    assert queue.due_counts == idle_since + PAUSE_COUNTS
    assert queue.take((), idle_since, queue.due_counts - 1) is None
    assert queue.take((), idle_since, queue.due_counts) == numbered(0x190, BURST_FRAMES_MAX)
    assert queue.due_counts is None


def test_a_mailbox_that_is_never_sent_ends_the_pause_in_time() -> None:
    """Other stations keep a heartbeat waiting; process data with better identifiers need not wait as well."""
    queue = after_a_burst()
    assert queue.take(IN_MAILBOX, 0, PAUSE_COUNTS_MAX - 1) is None
    assert queue.due_counts == PAUSE_COUNTS_MAX
    assert queue.take(IN_MAILBOX, 0, PAUSE_COUNTS_MAX) == numbered(0x190, BURST_FRAMES_MAX)


def test_services_need_no_pause() -> None:
    queue = after_a_burst()
    queue.put(0, Service.SDO, Frame(0x590, b""))
    assert queue.take(IN_MAILBOX, 0, 1) == Frame(0x590, b"")


def test_an_idle_bus_is_a_pause() -> None:
    """Process data that never fill the bus never wait, however many they are."""
    queue = TransmitQueue()
    now = 0
    for number in range(4 * BURST_FRAMES_MAX):
        queue.put_process_data(0, 0, numbered(0x190, number % 256))
        queue.put(0, Service.SDO, Frame(0x590, b""))
        assert queue.take((), now, now + PAUSE_COUNTS) == Frame(0x590, b"")
        now += PAUSE_COUNTS
        assert queue.take((Frame(0x590, b""),), now, now) == numbered(0x190, number % 256)


nodes = st.integers(0, NODES - 1)
actions = st.one_of(
    st.tuples(st.just("service"), nodes, st.sampled_from(Service)),
    st.tuples(st.just("pdo"), nodes, st.integers(0, PDOS - 1)),
    st.just(("take", 0, 0)),
)


@pytest.mark.slow
@given(st.lists(actions, max_size=400))
def test_nothing_is_lost_unsaid_and_the_queue_is_bounded(script: list[tuple[str, int, object]]) -> None:
    queue, put, lost, taken = TransmitQueue(), 0, 0, 0
    for action, node, what in script:
        if action == "take":
            taken += queue.take((), 0, 10 * PAUSE_COUNTS) is not None
            continue
        put += 1
        frame = Frame(node, b"")
        if isinstance(what, Service):
            lost += not queue.put(node, what, frame)
        else:
            assert isinstance(what, int)
            lost += not queue.put_process_data(node, what, frame)
        assert len(queue) == put - lost - taken <= NODES * (sum(PLACES.values()) + PDOS)
    assert len(drain(queue)) == put - lost - taken


def test_a_flood_is_bounded_and_counted() -> None:
    flood = [("put", node, service) for node in range(NODES) for service in Service] * 60
    one_example(test_nothing_is_lost_unsaid_and_the_queue_is_bounded, [*flood, ("pdo", 0, 1), ("take", 0, 0)])


def test_dropping_a_node_leaves_the_others_frames() -> None:
    queue = TransmitQueue()
    for node in (0, 1):
        queue.put(node, Service.SDO, numbered(0x590 + node, node))
        queue.put_process_data(node, 0, numbered(0x190 + node, node))
    queue.drop(0)
    assert drain(queue) == [numbered(0x591, 1), numbered(0x191, 1)]


def test_a_pause_ends_with_the_frames_that_wait_for_its_end() -> None:
    """A random host found it: after a reset in a pause, the board asked for polls in the past for ever."""
    queue = TransmitQueue()
    for _ in range(BURST_FRAMES_MAX):
        queue.put_process_data(0, 0, Frame(0x190, b""))
        assert queue.take((), 0, 0)
    for node in (0, 1):
        queue.put_process_data(node, 0, Frame(0x190 + node, b""))
    assert queue.take((), 0, 0) is None
    queue.drop(0)
    assert queue.due_counts == PAUSE_COUNTS
    queue.drop(1)
    assert queue.due_counts is None


def test_a_boot_up_message_does_not_wait_behind_heartbeats(pair: BenchBoard) -> None:
    """A random host found it: the places of the boot-up message were taken by heartbeats from before the reset."""
    for axis in (0, 1):
        pair.write(od.PRODUCER_HEARTBEAT_TIME, 1, axis)
    firmware, now_counts = pair.firmware, pair.now
    for _ in range(10):  # the bus is busy: nobody takes a frame
        now_counts += MS
        firmware.advance(now_counts)
        firmware.poll(now_counts)
    firmware.receive(Frame(COB_NMT, b"\x81\x10"), now_counts)
    of_first = [frame.data for frame in drain(firmware.transmit) if frame.cob_id == 0x710]
    assert of_first == [b"\x00"]
