"""Results on disk: rows come back as they went, nothing is lost or there twice, and a campaign is found again."""

import os
from dataclasses import replace
from pathlib import Path

import pytest

from steptwin.features.campaigns import results as results_module
from steptwin.features.campaigns.campaign import read_campaign
from steptwin.features.campaigns.results import Results
from steptwin.features.campaigns.row import Breach, Ended, Row
from steptwin.features.campaigns.sources import sources_of_file, sources_of_results
from steptwin.host.common.errors import InputError
from tests.features.campaigns.campaigns import SMALL
from tests.messages import refusing

ROW = Row(
    seed=7,
    robot="teaching-scara",
    motion="random moves",
    scenario="emergency stop",
    ended=Ended.STOPPED,
    message="th1: estop",
    codes=("0x9000",),
    faults=("1 estop", "2 supply"),
    struck=(1, 0),
    met=("emergency stop pressed",),
    asked=("steps", "power", "answer"),
    breaches=(Breach("steps", "lost", "th1: 3"), Breach("answer", "none")),
    parameters={"record_ms": 5.0, "reach": 0.04},
    choices={"joint": "th1"},
    margins={"bus": 0.75},
    duration_s=0.4,
    simulated_s=1.5,
    wall_s=0.1,
)


def _rows(seeds: range) -> list[Row]:
    return [replace(ROW, seed=seed, wall_s=seed / 10) for seed in seeds]


def test_rows_come_back_as_they_went(tmp_path: Path) -> None:
    results = Results(tmp_path)
    empty = Row(1, "", "", "", Ended.REFUSED, "no such joint")
    with results.writing():
        results.add([ROW, empty])
    (first, second) = Results(tmp_path).rows(range(8))
    assert (first, first.wall_s, second) == (ROW, ROW.wall_s, empty)
    assert Results(tmp_path).row(7) == ROW
    assert Results(tmp_path).row(8) is None
    assert ROW.cause == "steps: lost, after emergency stop pressed"


def test_files_are_written_as_rows_come(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(results_module, "PART_ROWS", 4)
    results = Results(tmp_path)
    with results.writing():
        for row in _rows(range(10)):
            results.add([row])
            assert sum(1 for _ in Results(tmp_path).rows(range(10))) == row.seed // 4 * 4 + (
                4 if row.seed % 4 == 3 else 0
            )
    assert [row.seed for row in Results(tmp_path).rows(range(10))] == list(range(10))
    assert [part.name for part in results.parts] == [f"part-{number:06}.parquet" for number in (1, 2, 3)]


def test_a_file_is_written_when_enough_time_has_passed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    results = Results(tmp_path)
    with results.writing():
        results.add(_rows(range(1)))
        assert not results.parts
        monkeypatch.setattr(results_module, "PART_S", 0.0)
        results.add(_rows(range(1, 2)))
        assert len(results.parts) == 1


def test_what_is_there_is_known(tmp_path: Path) -> None:
    results = Results(tmp_path)
    with results.writing():
        results.add(_rows(range(3, 5)))
    assert results.done(range(2, 7)).tolist() == [False, True, True, False, False]
    assert results.done(range(4, 5)).tolist() == [True]


def test_an_interrupt_loses_nothing(tmp_path: Path) -> None:
    results = Results(tmp_path)

    def interrupted() -> None:
        with results.writing():
            results.add(_rows(range(2)))
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert [row.seed for row in Results(tmp_path).rows(range(10))] == [0, 1]


def test_a_file_that_was_not_finished_counts_for_nothing(tmp_path: Path) -> None:
    results = Results(tmp_path)
    with results.writing():
        results.add(_rows(range(2)))
    (tmp_path / "rows" / "part-000002.parquet.part").write_bytes(b"PAR1 half a fi")
    assert results.done(range(3)).tolist() == [True, True, False]


def test_a_damaged_file_is_named(tmp_path: Path) -> None:
    results = Results(tmp_path)
    with results.writing():
        results.add(_rows(range(2)))
    results.parts[0].write_bytes(b"no parquet")
    with refusing(InputError):
        results.done(range(3))


@pytest.mark.skipif(os.name == "nt", reason="there a second program is not noticed")
def test_two_programs_never_run_the_same_campaign(tmp_path: Path) -> None:
    first, second = Results(tmp_path), Results(tmp_path)
    with first.writing(), refusing(InputError), second.writing():
        pass
    with second.writing():
        pass


def test_a_campaign_is_kept_with_its_files(tmp_path: Path) -> None:
    """The folder of results has all that its runs need, whatever becomes of the user's files."""
    beside, folder = tmp_path / "beside", tmp_path / "results"
    (beside / "deep").mkdir(parents=True)
    (beside / "wave.csv").write_text("t,th1,th2,d3,th4\n0,0,90,20,0\n0.5,2,91,21,1\n", encoding="utf-8")
    (beside / "deep" / "stop.toml").write_text(
        '[[fault]]\ndo = "estop"\npressed = true\nat_s = 0.1\n', encoding="utf-8"
    )
    text = SMALL.replace("moves = 1\nreach = { uniform = [0.02, 0.05] }", 'file = "../beside/wave.csv"')
    text += '[[scenario]]\nname = "filed"\nfile = "deep/stop.toml"\n'
    text = text.replace("[vary]\nrecord_ms = { choose = [5, 10] }\n", "")
    file = beside / "campaign.toml"
    file.write_text(text, encoding="utf-8")
    sources = sources_of_file(str(file))
    campaign, names = read_campaign(sources)
    sources.keep(folder, names)
    sources.keep(folder, names)  # the same campaign again
    kept, kept_names = read_campaign(sources_of_results(folder))
    assert (kept.scenario, kept_names) == (campaign.scenario, names)
    (beside / "wave.csv").write_text("t,th1,th2,d3,th4\n0,0,90,20,0\n0.5,3,91,21,1\n", encoding="utf-8")
    with refusing(InputError):
        sources_of_file(str(file)).keep(folder, names)
    with refusing(InputError):
        sources_of_results(beside / "deep")
