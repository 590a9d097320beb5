"""Scripts of run-image: what they do, and what is refused in them."""

from pathlib import Path

import pytest

from steptwin.features.stm32.running import RunPlan, run_image
from steptwin.features.stm32.script import duration_s, read_script
from steptwin.host.common.errors import InputError
from steptwin.protocol.frame import Frame
from tests.features.stm32.examples import EXAMPLES, example_board, example_robot


def _script(tmp_path: Path, text: str) -> Path:
    (path := tmp_path / "script.txt").write_text(text, encoding="utf-8")
    return path


def test_a_script_waits_sends_and_expects(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _, tools = example_board("compare_stepper")
    sent: list[bytes] = []
    monkeypatch.setattr(tools.chip, "give", lambda _usart, data: sent.append(data))
    sent_frames: list[Frame] = []
    monkeypatch.setattr(tools, "send_frame", sent_frames.append)
    text = (
        'can 201#0A0b\n# a comment\n\n  expect "ready\\n" 1ms  # "x"\n'
        '12ms send "G0 \\"#x\\"\\n"\nsend usart2 "\\u00b5"\n13.5ms\n'
    )
    instants = []
    for line in read_script(_script(tmp_path, text)):
        line.play(tools)
        instants.append(tools.now_s)
    assert sent == [b'G0 "#x"\n', "\u00b5".encode()]
    assert sent_frames == [Frame(0x201, b"\x0a\x0b")]
    assert instants == pytest.approx([0.01, 0.01, 0.012, 0.012, 0.0135], abs=1e-5)


@pytest.mark.parametrize(
    ("text", "time_s"), [("2s", 2.0), ("50ms", 0.05), ("1.5us", 1.5e-6), ("2", None), ("2 s", None)]
)
def test_a_time_has_a_number_and_a_unit(text: str, time_s: float | None) -> None:
    assert duration_s(text) == (None if time_s is None else pytest.approx(time_s))


@pytest.mark.parametrize(
    ("text", "errors"),
    [
        (
            "can 123#0\ncan 800#00",
            [
                ": line 1: can 123#0: is not written as can 201#0102",
                ": line 2: can 800#00: is not written as can 201#0102",
            ],
        ),
        ("# nothing\n", [': has no line with an action, such as expect "TEXT" 100ms']),
        ('sned "x"\n', [": line 1: action 'sned' is unknown: did you mean send?"]),
        (
            'send x\nexpect "y" soon\n',
            [
                ': line 1: send x: is not written as send "TEXT\\n"',
                ': line 2: expect "y" soon: is not written as expect "TEXT" 100ms',
            ],
        ),
        ('\n20 send "x"\n', [": line 2: action '20' is unknown: there are send, can, expect"]),
        ('send usart4 "x"\n', [': line 1: send usart4 "x": is not written as send "TEXT\\n"']),
        ('send "\\q"\n', [': line 1: send "\\q": its text has a \\ before a character that needs none']),
    ],
)
def test_what_is_no_script_is_refused_with_its_lines(tmp_path: Path, text: str, errors: list[str]) -> None:
    path = _script(tmp_path, text)
    with pytest.raises(InputError) as refused:
        read_script(path)
    assert list(refused.value.messages) == [f"{path}{error}" for error in errors]


def test_a_script_beyond_the_run_and_a_missing_answer_fail_it(tmp_path: Path) -> None:
    for text, reason in (
        ("2ms\n", "line 1: its time is beyond the 0.0015 s of the run: --for sets them"),
        ('expect "ok" 1ms\n', "line 1: USART1 has not sent 'ok' within 0.001 s, but 'ready\\n'"),
    ):
        path = _script(tmp_path, text)
        plan = RunPlan(for_s=0.0015, script=read_script(path), compiled=False)
        run = run_image(EXAMPLES / "compare_stepper.elf", example_robot(), plan)
        assert run.reasons == (f"{path}: {reason}",)


@pytest.mark.slow  # a tenth of a second of a polling image in plain Python
@pytest.mark.parametrize(("name", "missed"), [("gcode_stepper", 0), ("gcode_stepper_fault", 2)])
def test_the_example_of_g_code_moves_as_its_script_asks(name: str, missed: int) -> None:
    plan = RunPlan(for_s=1.0, script=read_script(EXAMPLES / "moves.txt"), compiled=False)
    run = run_image(EXAMPLES / f"{name}.elf", example_robot(), plan)
    assert run.reasons == ()
    assert [axis.steps for axis in run.axes] == [100, -40]
    assert run.interrupts[16 + 28][2] == missed
    told = "interrupt 28: 2 events came before the last one was served, or were set too late"
    assert run.hints == ((told,) if missed else ())
    assert (run.profile.masked_us_max > 400) == bool(missed)
