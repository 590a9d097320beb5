"""The questions to a running machine: which frames they are, and when they wait, begin again or are given up."""

from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steptwin.features.shadow.asking import Questions
from steptwin.host.common.errors import BusError, DeviceFaultError, InputError
from steptwin.protocol import od
from steptwin.protocol.cia402 import Control
from steptwin.protocol.dictionary import ObjectDictionary
from steptwin.protocol.frame import COB_EMCY, COB_NMT, COB_RPDO, COB_SDO_REQUEST, COB_SDO_RESPONSE, COB_SYNC, Frame
from steptwin.protocol.sdo_server import SdoServer
from steptwin.protocol.storage import checksum
from tests.messages import refusing

NAMES = {0x10: "th1", 0x11: "th2"}
QUESTIONS = 2 * 212
ENABLED = 0x0637
FAULT = 0x0608
ELSES_REQUEST = Frame(COB_SDO_REQUEST + 0x11, bytes.fromhex("40 6460 00 00000000"))
MORE = Callable[[float], Frame | None]


class Asked:
    """Two nodes that answer within 1 ms, and a clock that goes on by 1 ms with each frame or none."""

    def __init__(self) -> None:
        self.told: list[str] = []
        self.questions = Questions("lab", NAMES, self.told.append)
        self.nodes = {node_id: ObjectDictionary(node_id) for node_id in NAMES}
        self._servers = {node_id: SdoServer(dictionary) for node_id, dictionary in self.nodes.items()}
        for dictionary in self.nodes.values():
            dictionary.set(od.STATUSWORD, ENABLED)
        self.sent: list[tuple[float, Frame]] = []
        self._waiting: list[Frame] = []
        """Frames that are still to be on the bus."""
        self.now_s = 0.0

    def answer(self, request: Frame) -> Frame:
        node_id = request.cob_id - COB_SDO_REQUEST
        (data,) = self._servers[node_id].handle(request.data)
        return Frame(COB_SDO_RESPONSE + node_id, data)

    def run(self, seconds: float, also: MORE = lambda _: None) -> None:
        """Go on until all is asked or the time is over; `also` may put another frame on the bus at a time."""
        waiting, until_s = self._waiting, self.now_s + seconds
        while self.questions.standing is None and self.now_s < until_s:
            self.now_s += 0.001
            if more := also(self.now_s):
                waiting.append(more)
            request = self.questions.hear(self.now_s, waiting.pop(0) if waiting else None)
            if request is not None:
                self.sent.append((self.now_s, request))
                waiting.append(self.answer(request))


def at(moment_s: float, frame: Frame) -> MORE:
    """Put a frame on the bus once."""
    frames = [frame]
    return lambda now_s: frames.pop() if frames and now_s >= moment_s else None


def test_each_request_is_an_upload_and_all_is_told() -> None:
    asked = Asked()
    asked.nodes[0x11].set(od.POSITION_ACTUAL, -123_456)
    asked.nodes[0x11].set(od.PROFILE_VELOCITY, 777)
    asked.run(3.0)
    assert asked.told == []
    assert asked.questions.standing is not None
    assert asked.questions.standing[0x11][od.POSITION_ACTUAL] == -123_456
    assert asked.questions.standing[0x11][od.PROFILE_VELOCITY] == 777
    first_s, first = asked.sent[0]
    assert first_s == pytest.approx(0.301)
    assert first == Frame(0x610, bytes.fromhex("40 4160 00 00000000"))
    assert len(asked.sent) == QUESTIONS
    assert {(frame.cob_id, frame.data[0], frame.data[4:]) for _, frame in asked.sent} == {
        (0x610, 0x40, bytes(4)),
        (0x611, 0x40, bytes(4)),
    }
    assert asked.questions.hear(9.0, None) is None


@pytest.mark.parametrize(
    ("frame", "says"),
    [
        (ELSES_REQUEST, "th2: node 0x11 is asked by another client"),
        (Frame(COB_SDO_RESPONSE + 0x10, bytes.fromhex("4364600000000000")), "th1: node 0x10 answers another client"),
        (Frame(COB_RPDO[0] + 0x10, b"\x0f\x00\x01"), "th1: node 0x10 gets commands from a host"),
        (Frame(COB_NMT, b"\x01\x00"), "the nodes get commands from a host"),
        (Frame(COB_EMCY + 0x10, bytes.fromhex("1042010000000000")), "th1: node 0x10 reports an error or its end"),
        (Frame(0x710, b"\x00"), "th1: node 0x10 restarts"),
    ],
)
def test_who_gives_the_nodes_something_lets_it_begin_again(frame: Frame, says: str) -> None:
    """It waits until nobody has done so for 0.3 s, and takes nothing from before."""
    asked = Asked()
    asked.run(3.0, at(0.5, frame))
    assert asked.told == [f"{says}: asking again, for up to 30 s"]
    assert asked.questions.standing is not None
    again = [sent_s for sent_s, _ in asked.sent if sent_s > 0.51]
    assert again[0] >= 0.8
    assert len(again) == QUESTIONS


@pytest.mark.parametrize(
    "frame", [Frame(COB_SYNC, b""), Frame(0x77F, b"\x05"), Frame(0x710, b"\x05"), Frame(0x1C0, b"")]
)
def test_what_gives_the_nodes_nothing_does_not_matter(frame: Frame) -> None:
    asked = Asked()
    asked.run(3.0, at(0.5, frame))
    assert (asked.told, len(asked.sent)) == ([], QUESTIONS)


def test_others_all_the_time() -> None:
    asked = Asked()
    with refusing(BusError):
        asked.run(40.0, lambda now_s: ELSES_REQUEST if round(1000 * now_s) % 200 == 0 else None)
    assert asked.now_s == pytest.approx(30.2, abs=0.2)
    assert asked.sent == []
    assert len(asked.told) == 1


@pytest.mark.parametrize(
    ("address", "value", "says"),
    [
        (od.VELOCITY_ACTUAL, -1, "th2: moves, or has records to execute"),
        (od.BUFFER_POSITION, 3, "th2: moves, or has records to execute"),
        (od.STATUSWORD, ENABLED & ~0x400, "th2: moves, or has records to execute"),
        (od.CONTROLWORD, 0x0F | Control.HALT, "th2: is halted, and may have a way to go"),
    ],
)
def test_a_machine_that_moves_is_asked_again(address: int, value: int, says: str) -> None:
    asked = Asked()
    before = asked.nodes[0x11].get(address)
    asked.nodes[0x11].set(address, value)
    asked.run(2.0)
    assert asked.questions.standing is None
    assert asked.told == [f"{says}: asking again, for up to 30 s"]
    asked.nodes[0x11].set(address, before)
    asked.run(3.0)
    assert asked.questions.standing is not None
    asked = Asked()
    asked.nodes[0x11].set(address, value)
    with refusing(InputError):
        asked.run(40.0)


def test_a_machine_that_sets_off_meanwhile_is_asked_again() -> None:
    """What was asked first is asked again at the end."""
    asked = Asked()
    asked.run(0.5)
    asked.nodes[0x10].set(od.POSITION_ACTUAL, 5)
    asked.run(3.0)
    assert asked.told == ["th1: does not stay as it is: asking again, for up to 30 s"]
    assert asked.questions.standing is not None
    assert asked.questions.standing[0x10][od.POSITION_ACTUAL] == 5


@pytest.mark.parametrize(
    "values",
    [
        {od.STATUSWORD: FAULT, od.ERROR_CODE: 0x9000},
        {od.ERROR_REGISTER: 0x81},
    ],
)
def test_an_error_is_refused_at_once(values: dict[int, int]) -> None:
    asked = Asked()
    for address, value in values.items():
        asked.nodes[0x10].set(address, value)
    with refusing(DeviceFaultError):
        asked.run(1.0)


def test_a_node_without_an_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = Asked()
    monkeypatch.setattr(asked, "answer", lambda _: Frame(0x1C0, b""))
    with refusing(BusError):
        asked.run(3.0)
    assert asked.now_s == pytest.approx(1.3, abs=0.01)


def test_user_units() -> None:
    asked = Asked()
    asked.nodes[0x11].set(od.FEED_UNITS, 360_000)
    with refusing(InputError):
        asked.run(3.0)


def test_another_robot_and_another_firmware(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = Asked()
    asked.nodes[0x10].set(od.ROBOT_NAME_CRC, checksum("other"))
    with refusing(InputError):
        asked.run(3.0)
    asked = Asked()
    refusal = Frame(COB_SDO_RESPONSE + 0x10, bytes.fromhex("80 4160 00 00000206"))
    monkeypatch.setattr(asked, "answer", lambda _: refusal)
    with refusing(InputError):
        asked.run(3.0)


FRAMES = st.builds(
    Frame,
    st.sampled_from([0x000, 0x080, 0x090, 0x190, 0x210, 0x590, 0x591, 0x610, 0x611, 0x710]),
    st.binary(max_size=8),
)


@pytest.mark.slow
@settings(max_examples=200, deadline=None)
@given(heard=st.lists(st.one_of(st.none(), FRAMES), max_size=60), step_s=st.floats(0.001, 0.4))
def test_nothing_but_uploads_whatever_is_heard(heard: list[Frame | None], step_s: float) -> None:
    """Also if answers come that nobody has asked for, or none."""
    asked = Asked()
    for frame in heard:
        asked.now_s += step_s
        try:
            request = asked.questions.hear(asked.now_s, frame)
        except (BusError, DeviceFaultError, InputError):
            return
        if request is not None:
            assert request.cob_id in (0x610, 0x611)
            assert (request.data[0], request.data[4:]) == (0x40, bytes(4))
