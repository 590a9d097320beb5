"""Read MCAP files back with the library that their users have."""

import json
import sys
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from steptwin.host.cli.app import run
from steptwin.host.common.extras import installing
from steptwin.host.record.waveforms import Format, Window, write_waveform
from tests.host.record.waveforms.made import TEXTS, Made, levels, numbers, pulses, texts

SIGNALS = st.tuples(pulses("a"), levels("a", "dir"), numbers("b"), texts("b"))


class TestWithTheLibrary:
    @pytest.fixture(autouse=True)
    def _library(self) -> None:
        pytest.importorskip("mcap", reason="the extra `mcap` is not installed")

    @pytest.mark.slow
    @settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=30)
    @given(made=SIGNALS, begin=st.integers(0, 30_000), length=st.integers(1, 20_000))
    def test_reads_back_as_it_was(self, made: tuple[Made, ...], begin: int, length: int, tmp_path: Path) -> None:
        from mcap.reader import make_reader

        window, path = Window(begin, begin + length, 7_200), tmp_path / "t.mcap"
        write_waveform(path, [one.signal for one in made], window, Format.MCAP, "")
        read: dict[str, list[tuple[int, object]]] = {}
        with path.open("rb") as file:
            for _, channel, message in make_reader(file).iter_messages():
                value = json.loads(message.data)["value"]
                read.setdefault(channel.topic, []).append((message.log_time, value))
        for one, topic in zip(made, ("/a/step", "/a/dir", "/b/position_mm", "/b/drive_state"), strict=True):
            course = [(begin, one.at(begin)), *one.changes(begin, begin + length)]
            values = [(round(c * 125 / 9), TEXTS[int(v)] if one.signal.texts else v) for c, v in course]
            assert read[topic] == values

    @pytest.mark.slow
    def test_the_same_run_gives_the_same_bytes(self, carry_run: Path, tmp_path: Path) -> None:
        for name in ("first", "second"):
            words = ["--format", "mcap", "--axis", "th4", "--from", "0.5", "--out", str(tmp_path / name)]
            assert run(["trace", str(carry_run), *words]) == 0
        assert (tmp_path / "first").read_bytes() == (tmp_path / "second").read_bytes()


def test_without_the_library(
    carry_run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "mcap.writer", None)
    assert run(["trace", str(carry_run), "--format", "mcap", "--out", str(tmp_path / "t.mcap")]) == 2
    assert capsys.readouterr().err == f"steptwin: mcap: the library is not installed ({installing('mcap')})\n"
    assert not (tmp_path / "t.mcap").exists()
