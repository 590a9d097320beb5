"""The heartbeat consumer: the producers that it watches, their loss and their return (CiA 301, 7.5.2.16)."""

import pytest

from steptwin.protocol import od
from steptwin.protocol.dictionary import ObjectDictionary
from steptwin.protocol.heartbeat_consumer import HeartbeatConsumer
from steptwin.protocol.sdo_frames import AbortCode, SdoAbortError

ALIVE = bytes((5,))


def consumer_of(*words: int) -> HeartbeatConsumer:
    dictionary = ObjectDictionary(0x10)
    consumer = HeartbeatConsumer(dictionary)
    for subindex, word in enumerate(words, start=1):
        write(dictionary, subindex, word)
    return consumer


def write(dictionary: ObjectDictionary, subindex: int, word: int) -> None:
    dictionary.write(od.CONSUMER_HEARTBEATS[subindex - 1], word.to_bytes(4, "little"))


def test_watching_begins_with_the_first_heartbeat() -> None:
    consumer = consumer_of(0x7F_0064)
    assert consumer.producers == [0x7F]
    assert consumer.due_us is None
    assert consumer.poll(10**9) == []
    consumer.receive(0x7F, ALIVE, now_us=5000)
    assert consumer.due_us == 105_000


def test_a_silent_producer_is_lost_once_and_comes_back_once() -> None:
    consumer = consumer_of(0x7F_0064)
    consumer.receive(0x7F, ALIVE, 0)
    assert not consumer.receive(0x7F, ALIVE, 99_999)
    assert consumer.poll(199_998) == []
    assert consumer.poll(199_999) == [0x7F]
    assert consumer.poll(10**9) == []
    assert consumer.lost == [0x7F]
    assert consumer.receive(0x7F, ALIVE, 10**9)
    assert consumer.lost == []
    assert not consumer.receive(0x7F, ALIVE, 10**9)
    assert consumer.due_us == 10**9 + 100_000


def test_each_producer_has_its_own_time() -> None:
    consumer = consumer_of(0x7F_0064, 0x7E_00C8)
    consumer.receive(0x7F, ALIVE, 0)
    consumer.receive(0x7E, ALIVE, 0)
    assert consumer.due_us == 100_000
    assert consumer.poll(100_000) == [0x7F]
    assert consumer.due_us == 200_000
    assert consumer.poll(200_000) == [0x7E]


@pytest.mark.parametrize("data", [b"", b"\0", b"\x80", b"\5\5"], ids=["empty", "boot-up", "toggled boot-up", "long"])
def test_boot_up_messages_and_wrong_lengths_do_not_count(data: bytes) -> None:
    consumer = consumer_of(0x7F_0064)
    assert not consumer.receive(0x7F, data, 0)
    assert consumer.due_us is None


@pytest.mark.parametrize("word", [0, 0x7F_0000, 0x00_0064, 0x80_0064, 0xFF_FFFF])
def test_unused_entries(word: int) -> None:
    assert consumer_of(word, word).producers == []


def test_a_node_is_named_once() -> None:
    dictionary = ObjectDictionary(0x10)
    consumer = HeartbeatConsumer(dictionary)
    write(dictionary, 2, 0x7F_0064)
    with pytest.raises(SdoAbortError) as caught:
        write(dictionary, 1, 0x7F_00C8)
    assert caught.value.code is AbortCode.INCOMPATIBLE
    assert dictionary.get(od.CONSUMER_HEARTBEATS[0]) == 0
    write(dictionary, 1, 0x7F_0000)  # a time of 0 names no producer
    write(dictionary, 2, 0x7F_00C8)  # its own entry may change
    assert consumer.producers == [0x7F]


def test_writing_an_entry_restarts_its_watch() -> None:
    dictionary = ObjectDictionary(0x10)
    consumer = HeartbeatConsumer(dictionary)
    write(dictionary, 1, 0x7F_0064)
    consumer.receive(0x7F, ALIVE, 0)
    write(dictionary, 1, 0x7F_0064)
    assert consumer.due_us is None
    consumer.receive(0x7F, ALIVE, 0)
    write(dictionary, 1, 0)
    assert (consumer.producers, consumer.poll(10**9)) == ([], [])


def test_a_restart_takes_what_the_dictionary_holds() -> None:
    dictionary = ObjectDictionary(0x10)
    consumer = HeartbeatConsumer(dictionary)
    write(dictionary, 1, 0x7F_0064)
    consumer.receive(0x7F, ALIVE, 0)
    consumer.poll(100_000)
    dictionary.set(od.CONSUMER_HEARTBEATS[0], 0x7E_0064)
    consumer.restart()
    assert (consumer.producers, consumer.lost, consumer.due_us) == ([0x7E], [], None)
