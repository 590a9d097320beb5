"""Checks of the SDO server (CiA 301, section 7.2.4)."""

from typing import Final

from steptwin.features.conform.check import DiffersError, FailedError, SkippedError, expect, group
from steptwin.features.conform.node import (
    ANSWER_S,
    DEVICE_NAME,
    DEVICE_TYPE,
    HEARTBEAT_TIME,
    AbortError,
    NodeUnderTest,
    said,
    segment,
)
from steptwin.protocol.frame import COB_SDO_REQUEST, COB_SDO_RESPONSE
from steptwin.protocol.nmt import NmtState
from steptwin.protocol.sdo_frames import (
    ABORT,
    DOWNLOAD,
    EXPEDITED,
    SPECIFIER,
    UPLOAD,
    AbortCode,
    object_bytes,
    upload_request,
)

check = group("SDO")

_STALLED_S: Final = 3.0


@check("S1", "7.2.4.3.3", "expedited transfers with and without the size")
def expedited(node: NodeUnderTest) -> None:
    expect(len(node.upload(DEVICE_TYPE)) == 4, "0x1000 has not four bytes")
    with node.kept(HEARTBEAT_TIME) as before:
        node.download(HEARTBEAT_TIME, before)
        without = bytes((DOWNLOAD | EXPEDITED,)) + object_bytes(HEARTBEAT_TIME) + before.ljust(4, b"\0")
        answer = node.request(without)
        expect(answer is not None, "no answer to a download without its size")
        assert answer is not None
        if answer[0] & SPECIFIER == ABORT:
            raise DiffersError("a download without its size is refused")
        expect(node.upload(HEARTBEAT_TIME) == before, "a download without its size stores another value")


@check("S2", "7.2.4.3.6", "a long text comes in segments whose toggle alternates")
def segmented_upload(node: NodeUnderTest) -> None:
    try:
        data = node.upload(DEVICE_NAME)
    except AbortError as error:
        raise SkippedError(f"no 0x1008 ({error})") from error
    if len(data) <= 4:
        raise SkippedError(f"0x1008 has {len(data)} bytes, which come in one frame")


@check("S3", "7.2.4.3.3", "a value of two bytes may come in a segment")
def segmented_download(node: NodeUnderTest) -> None:
    with node.kept(HEARTBEAT_TIME) as before:
        try:
            node.begin_segments(HEARTBEAT_TIME, len(before))
            node.answer(segment(before, 0, last=True))
        except AbortError as error:
            raise DiffersError(f"refused: {error}") from error
        expect(node.upload(HEARTBEAT_TIME) == before, "stores another value")


@check("S6", "7.2.4.3.17", "a value of a wrong length aborts with 06070010h, 12h or 13h")
def lengths(node: NodeUnderTest) -> None:
    with node.kept(HEARTBEAT_TIME) as before:
        for data, codes in (
            (before + b"\0", (AbortCode.LENGTH_TOO_HIGH, AbortCode.LENGTH_MISMATCH)),
            (before[:1], (AbortCode.LENGTH_TOO_LOW, AbortCode.LENGTH_MISMATCH)),
        ):
            code = node.write_code(HEARTBEAT_TIME, data)
            expect(code in codes, f"{len(data)} bytes for two: {said(code)}")


@check("S7", "7.2.4.3.4", "a segment with the toggle of the one before aborts with 05030000h")
def toggles(node: NodeUnderTest) -> None:
    answer = node.request(upload_request(DEVICE_NAME))
    if answer is None or answer[0] & SPECIFIER != UPLOAD or answer[0] & EXPEDITED:
        raise SkippedError("0x1008 does not come in segments")
    answer = node.request(bytes((0x70,)).ljust(8, b"\0"))
    expect(answer is not None, "no answer to a first segment with toggle 1")
    assert answer is not None
    code = int.from_bytes(answer[4:8], "little") if answer[0] & SPECIFIER == ABORT else 0
    expect(
        code == AbortCode.TOGGLE_NOT_ALTERNATED, AbortError(code).args[0] if code else "is answered as the right one"
    )


@check("S8", "7.2.4.3.17", "an unknown command specifier aborts with 05040001h")
def unknown_specifier(node: NodeUnderTest) -> None:
    answer = node.request(bytes((0xE0,)) + object_bytes(DEVICE_TYPE) + bytes(4))
    _aborts(answer, AbortCode.COMMAND_UNKNOWN)
    expect(len(node.upload(DEVICE_TYPE)) == 4, "the next request fails")


@check("S9", "7.2.4.3.17", "a segment without a transfer aborts with 05040001h")
def segment_alone(node: NodeUnderTest) -> None:
    answer = node.request(bytes((0x60,)).ljust(8, b"\0"))
    if answer is None:
        raise DiffersError("no answer")
    _aborts(answer, AbortCode.COMMAND_UNKNOWN)


@check("S10", "7.2.4.3.2", "a new request during a transfer is served")
def new_request(node: NodeUnderTest) -> None:
    node.begin_segments(HEARTBEAT_TIME, 2)
    mark = node.mark()
    node.send(COB_SDO_REQUEST + node.node_id, upload_request(DEVICE_TYPE))
    served = node.within(
        ANSWER_S, mark, COB_SDO_RESPONSE + node.node_id, lambda data: data[:1] != b"" and data[0] & SPECIFIER == UPLOAD
    )
    if served is None:
        expect(len(node.upload(DEVICE_TYPE)) == 4, "neither this request nor the next one is served")
        raise DiffersError("the first transfer is aborted, and the next request served")


@check("S11", "7.2.4.3.17", "after the client's abort the next request is served")
def client_abort(node: NodeUnderTest) -> None:
    node.begin_segments(HEARTBEAT_TIME, 2)
    abort = bytes((ABORT,)) + object_bytes(HEARTBEAT_TIME) + int(AbortCode.DEVICE_STATE).to_bytes(4, "little")
    mark = node.mark()
    node.send(COB_SDO_REQUEST + node.node_id, abort)
    node.wait(0.05)
    expect(not node.since(mark, COB_SDO_RESPONSE + node.node_id), "an abort is answered")
    expect(len(node.upload(DEVICE_TYPE)) == 4, "the next request fails")


@check("S12", "7.2.4.3.17", "a transfer that stands still does not block the server")
def stalled(node: NodeUnderTest) -> None:
    node.begin_segments(HEARTBEAT_TIME, 2)
    node.wait(_STALLED_S)
    expect(len(node.upload(DEVICE_TYPE)) == 4, "the next request fails")


@check("S13", "7.2.4.3", "a request of less than eight bytes is no request")
def short_requests(node: NodeUnderTest) -> None:
    for length in (0, 4):
        answer = node.request(upload_request(DEVICE_TYPE)[:length], 0.1)
        expect(
            answer is None or answer[0] & SPECIFIER == ABORT, f"a request of {length} bytes is answered with a value"
        )
        expect(len(node.upload(DEVICE_TYPE)) == 4, f"after a request of {length} bytes the next one fails")


@check("S14", "7.3.2.3", "in STOPPED there is no SDO")
def stopped(node: NodeUnderTest) -> None:
    node.enter(NmtState.STOPPED)
    try:
        expect(node.request(upload_request(DEVICE_TYPE), 0.2) is None, "a request is answered")
    finally:
        node.enter(NmtState.PRE_OPERATIONAL)


@check("S15", "7.2.4.3.9", "a block size of 0 or 128 aborts with 05040002h")
def block_size(node: NodeUnderTest) -> None:
    for size in (0, 128):
        answer = node.request(bytes((0xA0,)) + object_bytes(DEVICE_NAME) + bytes((size, 0, 0, 0)))
        if answer is None:
            raise FailedError(f"no answer to the size {size}")
        code = int.from_bytes(answer[4:8], "little") if answer[0] & SPECIFIER == ABORT else 0
        if code == AbortCode.COMMAND_UNKNOWN:
            raise SkippedError("no block transfer")
        expect(code == AbortCode.BLOCK_SIZE_INVALID, f"size {size}: {said(code)}")


def _aborts(answer: bytes | None, code: AbortCode) -> None:
    if answer is None:
        raise FailedError("no answer")
    expect(answer[0] & SPECIFIER == ABORT, f"is answered by {answer[0]:02X}h, which is no abort")
    found = int.from_bytes(answer[4:8], "little")
    expect(found == code, said(found))
