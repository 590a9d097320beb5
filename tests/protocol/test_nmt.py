"""NMT commands and the producer of heartbeats."""

import pytest

from steptwin.protocol.nmt import HeartbeatProducer, NmtCommand, NmtState, command_for, target_of


class TestNmt:
    @pytest.mark.parametrize(
        ("data", "command"),
        [
            ("01 00", NmtCommand.START),
            ("02 12", NmtCommand.STOP),
            ("80 12", NmtCommand.ENTER_PRE_OPERATIONAL),
            ("81 00", NmtCommand.RESET_NODE),
            ("82 12", NmtCommand.RESET_COMMUNICATION),
            ("01 13", None),
            ("03 00", None),
            ("01", None),
            ("", None),
            ("01 00 00", None),
        ],
    )
    def test_commands_for_node_0x12(self, data: str, command: NmtCommand | None) -> None:
        assert command_for(bytes.fromhex(data), 0x12) is command

    def test_targets(self) -> None:
        assert [target_of(command) for command in NmtCommand] == [
            NmtState.OPERATIONAL,
            NmtState.STOPPED,
            NmtState.PRE_OPERATIONAL,
            NmtState.INITIALISING,
            NmtState.INITIALISING,
        ]


class TestHeartbeat:
    def test_is_silent_until_a_period_is_set(self) -> None:
        producer = HeartbeatProducer()
        assert producer.due_us is None
        assert not producer.poll(10**9)

    def test_keeps_its_period_however_late_it_is_polled(self) -> None:
        producer = HeartbeatProducer()
        producer.set_period(1000, now_us=500)
        assert [producer.poll(t) for t in (499, 500, 501, 1499, 1700, 2499, 2500)] == [
            False,
            True,
            False,
            False,
            True,
            False,
            True,
        ]
        producer.set_period(0, now_us=3000)
        assert not producer.poll(10**9)
