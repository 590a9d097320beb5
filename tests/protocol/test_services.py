"""NMT, heartbeat, EMCY, PVT flow control and data types."""

from functools import partial

import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.protocol.cia402 import ErrorCode
from steptwin.protocol.emergency import PLACES as EMCY_PLACES
from steptwin.protocol.emergency import EmergencyProducer
from steptwin.protocol.entry import DataType, decode, encode
from steptwin.protocol.nmt import HeartbeatProducer, NmtCommand, NmtState, command_for, target_of
from steptwin.protocol.pvt import PvtRecord, PvtStatus, Verdict, judge


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


def _is_code(code: ErrorCode, active: ErrorCode, _detail: int) -> bool:
    return active is code


def sent(emergency: EmergencyProducer) -> list[bytes]:
    """Return all frames that wait."""
    frames = []
    while data := emergency.poll(0):
        frames.append(data)
    return frames


class TestEmergency:
    def test_payload_register_and_history(self) -> None:
        emergency = EmergencyProducer()
        emergency.raise_error(ErrorCode.PVT_UNDERRUN, 0x0102)
        emergency.raise_error(ErrorCode.PDO_TOO_SHORT)
        assert emergency.poll(0) == bytes.fromhex("01ff 81 0201000000")
        assert emergency.poll(0) == bytes.fromhex("1082 91 0000000000")
        assert emergency.poll(0) is None
        assert list(emergency.history) == [0x8210, 0xFF01]

    def test_an_error_is_reported_once_until_it_is_resolved(self) -> None:
        emergency = EmergencyProducer()
        for _ in range(3):
            emergency.raise_error(ErrorCode.PDO_TOO_SHORT, 1)
        assert emergency.poll(0) == bytes.fromhex("1082 11 0100000000")
        assert emergency.poll(0) is None
        emergency.raise_error(ErrorCode.PDO_TOO_SHORT, 2)
        assert emergency.poll(0) == bytes.fromhex("1082 11 0200000000")
        assert list(emergency.history) == [0x8210] * 2

    def test_register_bits_fall_one_by_one(self) -> None:
        """CiA 301 figure 51: "no error" with the rest of the register, at last with an empty one."""
        emergency = EmergencyProducer()
        for code in (ErrorCode.PVT_UNDERRUN, ErrorCode.HEARTBEAT_LOST, ErrorCode.PARAMETER):
            emergency.raise_error(code)
            emergency.poll(0)
        for code, left in ((ErrorCode.HEARTBEAT_LOST, 0xA1), (ErrorCode.PVT_UNDERRUN, 0x21), (ErrorCode.PARAMETER, 0)):
            emergency.resolve(partial(_is_code, code))
            assert not emergency.is_active(code)
            assert emergency.register == left
            assert emergency.poll(0) == bytes((0, 0, left, 0, 0, 0, 0, 0))
        emergency.resolve(lambda _code, _detail: True)
        assert emergency.poll(0) is None

    def test_a_bit_stays_while_one_of_its_errors_is_left(self) -> None:
        emergency = EmergencyProducer()
        emergency.raise_error(ErrorCode.PDO_TOO_SHORT, 1)
        emergency.raise_error(ErrorCode.PDO_TOO_SHORT, 2)
        emergency.resolve(lambda _code, detail: detail == 1)
        assert emergency.register == 0x11
        emergency.resolve(lambda _code, detail: detail == 2)
        assert emergency.register == 0

    def test_inhibit_time_spaces_the_frames(self) -> None:
        emergency = EmergencyProducer()
        inhibit_100us = 30  # 3 ms
        emergency.raise_error(ErrorCode.PVT_UNDERRUN)
        emergency.raise_error(ErrorCode.PARAMETER)
        assert emergency.poll(1000, inhibit_100us) is not None
        assert emergency.due_us == 4000
        assert emergency.poll(3999, inhibit_100us) is None
        assert emergency.poll(4000, inhibit_100us) is not None

    def test_a_communication_reset_ends_communication_errors_and_drops_what_waits(self) -> None:
        emergency = EmergencyProducer()
        emergency.raise_error(ErrorCode.PVT_UNDERRUN)
        emergency.raise_error(ErrorCode.PDO_TOO_SHORT)
        emergency.reset_communication()
        assert emergency.poll(0) is None
        assert (emergency.register, list(emergency.history)) == (0x81, [0x8210, 0xFF01])

    def test_power_up_has_no_errors(self) -> None:
        emergency = EmergencyProducer()
        emergency.raise_error(ErrorCode.PVT_UNDERRUN)
        emergency.forget()
        assert emergency.due_us is None
        assert (emergency.register, list(emergency.history)) == (0, [])

    def test_history_keeps_the_latest_eight(self) -> None:
        emergency = EmergencyProducer()
        for detail in range(9):
            emergency.raise_error(ErrorCode.PARAMETER, detail)
        emergency.raise_error(ErrorCode.LATE_STEP)
        assert list(emergency.history) == [ErrorCode.LATE_STEP] + [ErrorCode.PARAMETER] * 7

    def test_one_frame_more_than_there_are_places_is_lost(self) -> None:
        emergency = EmergencyProducer()
        for detail in range(EMCY_PLACES):
            emergency.raise_error(ErrorCode.SEGMENT_REFUSED, detail)
        assert emergency.lost == 0
        emergency.raise_error(ErrorCode.SEGMENT_REFUSED, EMCY_PLACES)
        assert emergency.lost == 2  # the report of the loss needs a place itself
        frames = sent(emergency)
        details = [int.from_bytes(data[3:], "little") for data in frames if data[1] == 0xFF]
        assert details == list(range(2, EMCY_PLACES + 1))
        assert frames[-2:] == [bytes.fromhex("1081910200000000"), bytes.fromhex("0000810000000000")]
        assert not emergency.is_active(ErrorCode.CAN_OVERRUN)

    def test_a_lasting_flood_is_one_loss_to_report(self) -> None:
        emergency = EmergencyProducer()
        for _ in range(1000):
            emergency.raise_error(ErrorCode.PDO_TOO_SHORT, 1)
            emergency.resolve(partial(_is_code, ErrorCode.PDO_TOO_SHORT))
        frames = sent(emergency)
        assert len(frames) == EMCY_PLACES + 1
        assert [data[:2] for data in frames].count(b"\x10\x81") == 1

    @given(
        st.lists(
            st.tuples(
                st.sampled_from(list(ErrorCode)[1:]), st.integers(0, 3), st.sampled_from(("raise", "end", "send"))
            ),
            max_size=200,
        )
    )
    def test_the_last_frame_of_every_code_and_the_last_register_are_sent(
        self, script: list[tuple[ErrorCode, int, str]]
    ) -> None:
        emergency = EmergencyProducer()
        frames: list[bytes] = []
        raised: dict[ErrorCode, int] = {}
        for code, detail, act in script:
            if act == "raise":
                if not emergency.is_active(code):
                    raised[code] = detail
                    emergency.raise_error(code, detail)
            elif act == "end":
                emergency.resolve(partial(_is_code, code))
            elif data := emergency.poll(0):
                frames.append(data)
        last = sent(emergency)
        assert len(last) <= EMCY_PLACES + 1
        frames += last
        reported = {int.from_bytes(data[:2], "little"): int.from_bytes(data[3:], "little") for data in frames}
        assert {code: reported[code] for code in raised if code != ErrorCode.CAN_OVERRUN} == {
            code: detail for code, detail in raised.items() if code != ErrorCode.CAN_OVERRUN
        }
        assert (frames[-1][2] if frames else 0) == emergency.register

    @pytest.mark.parametrize("code", list(ErrorCode))
    def test_every_code_has_its_register_bits(self, code: ErrorCode) -> None:
        assert code.register & 1 == (code is not ErrorCode.NONE)


class TestPvt:
    def test_verdicts_over_the_whole_circle(self) -> None:
        """All 256 x 256 pairs: the expected number is taken, up to 128 behind it is old, the rest is a gap."""
        for expected in range(256):
            for sequence in range(256):
                ahead = (sequence - expected) % 256
                verdict = judge(sequence, expected, free=1)
                if ahead == 0:
                    assert verdict is Verdict.PUSH
                    assert judge(sequence, expected, free=0) is Verdict.FULL
                else:
                    assert verdict is (Verdict.GAP if ahead < 128 else Verdict.STALE)

    def test_record_bytes(self) -> None:
        assert PvtRecord(-2, 0x01_0203, 10, 255).encode() == bytes.fromhex("feffff 030201 0a ff")

    @pytest.mark.parametrize("displacement", [1 << 23, -(1 << 23) - 1])
    def test_record_refuses_values_beyond_its_fields(self, displacement: int) -> None:
        with pytest.raises(OverflowError):
            PvtRecord(displacement, 0, 1, 0).encode()

    def test_status(self) -> None:
        status = PvtStatus.decode(bytes.fromhex("05 40 80 04 78563412"))
        assert status == (5, 64, 128, 4, 0x12345678)
        with pytest.raises(ValueError, match="7"):
            PvtStatus.decode(bytes(7))


@given(st.data())
def test_datatypes_round_trip_over_their_ranges(data: st.DataObject) -> None:
    kind = data.draw(st.sampled_from([t for t in DataType if t.size]))
    value = data.draw(st.sampled_from([kind.low, kind.high]) | st.integers(kind.low, kind.high))
    assert decode(kind, encode(kind, value)) == value
