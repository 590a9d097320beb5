"""MCAP files read back by the library that their users have."""

import json
import sys
from collections import Counter
from pathlib import Path
from struct import unpack_from

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from host.cli.app import run
from host.waveforms import SCALES, Format, Window, write_waveform
from tests.waveforms.made import TEXTS, Made, levels, numbers, pulses, texts

SIGNALS = st.tuples(pulses("a"), levels("a", "dir"), numbers("b"), texts("b"))


class TestWithTheLibrary:
    @pytest.fixture(autouse=True)
    def _library(self) -> None:
        pytest.importorskip("mcap", reason="mcap is not installed")

    @settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=30)
    @given(made=SIGNALS, begin=st.integers(0, 30_000), length=st.integers(1, 20_000), per_chunk=st.integers(1, 300))
    def test_reads_back_as_it_was(
        self,
        made: tuple[Made, ...],
        begin: int,
        length: int,
        per_chunk: int,
        tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        """Both readers: the one that follows the summary, and the one that goes from record to record."""
        from mcap.reader import NonSeekingReader, make_reader

        monkeypatch.setattr("host.waveforms.mcap_file.MESSAGES_PER_CHUNK", per_chunk)
        window, path = Window(begin, begin + length, 7_200), tmp_path / "t.mcap"
        write_waveform(path, [one.signal for one in made], window, Format.MCAP, SCALES["1us"], "")
        read: dict[str, list[tuple[int, object]]] = {}
        with path.open("rb") as file:
            sought = list(make_reader(file, validate_crcs=True).iter_messages())
            file.seek(0)
            assert list(NonSeekingReader(file, validate_crcs=True).iter_messages()) == sought
        for _, channel, message in sought:
            read.setdefault(channel.topic, []).append((message.log_time, json.loads(message.data)["value"]))
        for one, topic in zip(made, ("/a/step", "/a/dir", "/b/position_mm", "/b/drive_state"), strict=True):
            course = [(begin, one.at(begin)), *one.changes(begin, begin + length)]
            values = [(round(c * 125 / 9), TEXTS[int(v)] if one.signal.texts else v) for c, v in course]
            assert read[topic] == values

    @pytest.fixture
    def mcap_file(self, carry_run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
        """The begin of a run, in several chunks."""
        monkeypatch.setattr("host.waveforms.mcap_file.MESSAGES_PER_CHUNK", 1_000)
        path = tmp_path / "t.mcap"
        assert run(["trace", str(carry_run), "--format", "mcap", "--to", "0.3", "--out", str(path)]) == 0
        return path

    def test_the_index_leads_to_each_message(self, mcap_file: Path) -> None:
        """Which the library's readers do not need; viewers do."""
        from mcap.records import Chunk, Message, MessageIndex
        from mcap.stream_reader import StreamReader, breakup_chunk
        from zstandard import ZstdDecompressor

        indexed: list[tuple[int, int]] = []
        messages: list[tuple[int, int]] = []
        with mcap_file.open("rb") as file:
            for record in StreamReader(file, emit_chunks=True).records:
                if isinstance(record, Chunk):
                    content = ZstdDecompressor().decompress(record.data)
                    messages += [(m.channel_id, m.log_time) for m in breakup_chunk(record) if isinstance(m, Message)]
                if isinstance(record, MessageIndex):
                    for time_ns, offset in record.records:
                        opcode, channel, log_time_ns = unpack_from("<B8xH4xQ", content, offset)
                        assert (opcode, channel, log_time_ns) == (5, record.channel_id, time_ns)
                        indexed.append((channel, time_ns))
        assert len(messages) > 3_000
        assert sorted(indexed) == sorted(messages)

    def test_the_summary_is_that_of_the_messages(self, mcap_file: Path) -> None:
        from mcap.reader import make_reader

        with mcap_file.open("rb") as file:
            reader = make_reader(file, validate_crcs=True)
            messages = [message for _, _, message in reader.iter_messages()]
            summary = reader.get_summary()
        assert summary
        assert summary.statistics
        times_ns = [message.log_time for message in messages]
        statistics = summary.statistics
        assert statistics.channel_message_counts == Counter(message.channel_id for message in messages)
        assert (statistics.message_start_time, statistics.message_end_time) == (0, max(times_ns))
        assert (statistics.message_count, statistics.schema_count) == (len(messages), 3)
        assert (statistics.channel_count, statistics.chunk_count) == (len(summary.channels), len(summary.chunk_indexes))
        position = next(c for c in summary.channels.values() if c.topic == "/d3/position_mm")
        assert json.loads(summary.schemas[position.schema_id].data)["properties"]["value"]["type"] == "number"

    def test_the_same_run_gives_the_same_bytes(self, carry_run: Path, tmp_path: Path) -> None:
        for name in ("first", "second"):
            words = ["--format", "mcap", "--axis", "th4", "--from", "0.5", "--out", str(tmp_path / name)]
            assert run(["trace", str(carry_run), *words]) == 0
        assert (tmp_path / "first").read_bytes() == (tmp_path / "second").read_bytes()


def test_without_the_library(
    carry_run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "zstandard", None)
    assert run(["trace", str(carry_run), "--format", "mcap", "--out", str(tmp_path / "t.mcap")]) == 2
    assert capsys.readouterr().err == "steptwin: mcap: zstandard is not installed (pip install 'steptwin[mcap]')\n"
    assert not (tmp_path / "t.mcap").exists()
