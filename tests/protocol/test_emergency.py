"""Emergencies: error register and history, inhibit time, places, floods."""

from functools import partial

import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.protocol.cia402 import ErrorCode
from steptwin.protocol.emergency import PLACES as EMCY_PLACES
from steptwin.protocol.emergency import EmergencyProducer
from tests.one_example import one_example


def _is_code(code: ErrorCode, active: ErrorCode, _detail: int) -> bool:
    return active is code


def sent(emergency: EmergencyProducer) -> list[bytes]:
    """Return all frames that wait."""
    frames = []
    while data := emergency.poll(0):
        frames.append(data)
    return frames


def test_payload_register_and_history() -> None:
    emergency = EmergencyProducer()
    emergency.raise_error(ErrorCode.PVT_UNDERRUN, 0x0102)
    emergency.raise_error(ErrorCode.PDO_TOO_SHORT)
    assert emergency.poll(0) == bytes.fromhex("01ff 81 0201000000")
    assert emergency.poll(0) == bytes.fromhex("1082 91 0000000000")
    assert emergency.poll(0) is None
    assert list(emergency.history) == [0x8210, 0xFF01]


def test_an_error_is_reported_once_until_it_is_resolved() -> None:
    emergency = EmergencyProducer()
    for _ in range(3):
        emergency.raise_error(ErrorCode.PDO_TOO_SHORT, 1)
    assert emergency.poll(0) == bytes.fromhex("1082 11 0100000000")
    assert emergency.poll(0) is None
    emergency.raise_error(ErrorCode.PDO_TOO_SHORT, 2)
    assert emergency.poll(0) == bytes.fromhex("1082 11 0200000000")
    assert list(emergency.history) == [0x8210] * 2


def test_register_bits_fall_one_by_one() -> None:
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


def test_a_bit_stays_while_one_of_its_errors_is_left() -> None:
    emergency = EmergencyProducer()
    emergency.raise_error(ErrorCode.PDO_TOO_SHORT, 1)
    emergency.raise_error(ErrorCode.PDO_TOO_SHORT, 2)
    emergency.resolve(lambda _code, detail: detail == 1)
    assert emergency.register == 0x11
    emergency.resolve(lambda _code, detail: detail == 2)
    assert emergency.register == 0


def test_inhibit_time_spaces_the_frames() -> None:
    emergency = EmergencyProducer()
    inhibit_100us = 30  # 3 ms
    emergency.raise_error(ErrorCode.PVT_UNDERRUN)
    emergency.raise_error(ErrorCode.PARAMETER)
    assert emergency.poll(1000, inhibit_100us) is not None
    assert emergency.due_us == 4000
    assert emergency.poll(3999, inhibit_100us) is None
    assert emergency.poll(4000, inhibit_100us) is not None


def test_postponing_does_not_shorten_the_inhibit_time() -> None:
    emergency = EmergencyProducer()
    emergency.raise_error(ErrorCode.PVT_UNDERRUN)
    emergency.raise_error(ErrorCode.PARAMETER)
    assert emergency.poll(1000, 30) is not None
    emergency.postpone(2000)
    assert emergency.due_us == 4000
    emergency.postpone(5000)
    assert emergency.due_us == 5000


def test_a_communication_reset_ends_communication_errors_and_drops_what_waits() -> None:
    emergency = EmergencyProducer()
    emergency.raise_error(ErrorCode.PVT_UNDERRUN)
    emergency.raise_error(ErrorCode.PDO_TOO_SHORT)
    emergency.reset_communication()
    assert emergency.poll(0) is None
    assert (emergency.register, list(emergency.history)) == (0x81, [0x8210, 0xFF01])


def test_power_up_has_no_errors() -> None:
    emergency = EmergencyProducer()
    emergency.raise_error(ErrorCode.PVT_UNDERRUN)
    emergency.forget()
    assert emergency.due_us is None
    assert (emergency.register, list(emergency.history)) == (0, [])


def test_history_keeps_the_latest_eight() -> None:
    emergency = EmergencyProducer()
    for detail in range(9):
        emergency.raise_error(ErrorCode.PARAMETER, detail)
    emergency.raise_error(ErrorCode.LATE_STEP)
    assert list(emergency.history) == [ErrorCode.LATE_STEP] + [ErrorCode.PARAMETER] * 7


def test_one_frame_more_than_there_are_places_is_lost() -> None:
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


def test_a_lasting_flood_is_one_loss_to_report() -> None:
    emergency = EmergencyProducer()
    for _ in range(1000):
        emergency.raise_error(ErrorCode.PDO_TOO_SHORT, 1)
        emergency.resolve(partial(_is_code, ErrorCode.PDO_TOO_SHORT))
    frames = sent(emergency)
    assert len(frames) == EMCY_PLACES + 1
    assert [data[:2] for data in frames].count(b"\x10\x81") == 1


@pytest.mark.slow
@given(
    st.lists(
        st.tuples(st.sampled_from(list(ErrorCode)[1:]), st.integers(0, 3), st.sampled_from(("raise", "end", "send"))),
        max_size=200,
    )
)
def test_the_last_frame_of_every_code_and_the_last_register_are_sent(script: list[tuple[ErrorCode, int, str]]) -> None:
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
def test_every_code_has_its_register_bits(code: ErrorCode) -> None:
    assert code.register & 1 == (code is not ErrorCode.NONE)


def test_the_last_frames_of_a_flood_are_sent() -> None:
    codes = [ErrorCode.ESTOP, ErrorCode.PDO_TOO_SHORT, ErrorCode.FOLLOWING_ERROR]
    script = [(codes[number % 3], number % 4, ("raise", "end")[number % 5 == 4]) for number in range(90)]
    one_example(test_the_last_frame_of_every_code_and_the_last_register_are_sent, [*script, (codes[0], 0, "send")])
