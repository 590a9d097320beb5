"""A campaign believes its own files only: copies, others' files and impossible values are named or left alone."""

import math
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from steptwin.features.campaigns.results import Results
from steptwin.features.campaigns.row import Breach, Ended, Row, schema
from tests.end_to_end.command_line import refusal, run_json
from tests.features.campaigns.campaigns import SMALL
from tests.host.complaints import complaint_of

MIB = 1 << 20


def _document(seed: int = 0, **changes: Any) -> dict[str, Any]:
    """Return a row as it is in a file."""
    document: dict[str, Any] = dict.fromkeys(schema().names, "") | {"seed": seed, "ended": "done"}
    document |= {name: [] for name in ("codes", "met", "asked", "choices")}
    document |= {"faults": ["1 estop"], "struck": [1], "parameters": [("reach", 0.1)], "margins": [("bus", 0.5)]}
    document |= {"breaches": [{"invariant": "steps", "what": "lost", "detail": "th1: 3"}]}
    return document | dict.fromkeys(("duration_s", "simulated_s", "wall_s"), 1.0) | changes


def _parameters(seed: int) -> list[tuple[str, float]]:
    """Return a thousand parameters that no other row has."""
    return [(f"{seed}.{number}", 1.0) for number in range(1000)]


def _written(folder: Path, *documents: dict[str, Any], name: str = "part-000001.parquet", columns: Any = None) -> Path:
    (folder / "rows").mkdir(exist_ok=True)
    path = folder / "rows" / name
    pq.write_table(pa.Table.from_pylist(list(documents), schema=columns or schema()), path, compression="zstd")
    return path


def _complaint(folder: Path) -> str:
    told = complaint_of(lambda: Results(folder).done(range(10)))
    assert complaint_of(lambda: list(Results(folder).rows(range(10)))) == told
    return told.replace(f"{folder}/rows/", "")


def test_a_row_as_written_here_is_believed(tmp_path: Path) -> None:
    _written(tmp_path, _document())
    (row,) = Results(tmp_path).rows(range(10))
    assert (row.ended, row.struck, row.margins, row.breaches) == (
        Ended.DONE,
        (1,),
        {"bus": 0.5},
        (Breach("steps", "lost", "th1: 3"),),
    )


@pytest.mark.parametrize("name", [name for name in schema().names if name != "seed"])
def test_no_value_may_be_null(name: str, tmp_path: Path) -> None:
    _written(tmp_path, _document(), _document(1, **{name: None}))
    assert _complaint(tmp_path) == f"part-000001.parquet: {name}: has 1 values that are null"


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"ended": "tired"}, "ended: 'tired' is none of done, stopped, refused, crashed"),
        ({"seed": -1}, "seed: -1 is below 0"),
        ({"wall_s": -0.5}, "wall_s: -0.5 is below 0"),
        ({"simulated_s": math.nan}, "simulated_s: has a number that is not finite"),
        ({"margins": [("bus", math.inf)]}, "margins: has a number that is not finite"),
        ({"margins": [("bus", None)]}, "margins: has 1 values that are null"),
        ({"codes": [None]}, "codes: has 1 values that are null"),
        ({"breaches": [{"invariant": "x", "what": None, "detail": ""}]}, "breaches: has 1 values that are null"),
        ({"struck": []}, "struck: tells of other faults than there are"),
        ({"message": "x" * 50_000}, "message: has a text of 50000 bytes"),
        ({"seed": 0}, "seed: one is there twice"),
    ],
)
def test_impossible_values_are_named(changes: dict[str, Any], told: str, tmp_path: Path) -> None:
    _written(tmp_path, _document(), _document(1) | changes)
    assert _complaint(tmp_path) == f"part-000001.parquet: {told}"


def test_a_text_that_is_none_and_columns_of_others_are_named(tmp_path: Path) -> None:
    texts = schema().set(1, pa.field("robot", pa.binary()))
    _written(tmp_path, _document(robot=b"\xff"), columns=texts)
    columns = "part-000001.parquet: is no file of a campaign's rows: its columns are others"
    assert _complaint(tmp_path) == columns
    path = _written(tmp_path, _document(robot="qqqq"))
    path.write_bytes(path.read_bytes().replace(b"qqqq", b"\xff\xfe\xfd\xfc"))
    assert _complaint(tmp_path).startswith("part-000001.parquet: is no file of a campaign's rows: ")


@pytest.mark.parametrize(
    ("documents", "told"),
    [
        pytest.param(
            lambda: [_document(seed, message="x" * 30_000) for seed in range(9_000)],
            "takes 257.8 MiB of memory",
            marks=pytest.mark.slow,
        ),
        (lambda: [_document(0, codes=["x"] * 1_000_001)], "has a column of more than 1000000 values"),
        pytest.param(lambda: [_document(0, message="x" * 66 * MIB)], "takes 66 MiB of memory", marks=pytest.mark.slow),
        (
            lambda: [_document(seed, parameters=_parameters(seed)) for seed in range(101)],
            "parameters: has 101000 different texts",
        ),
        pytest.param(
            lambda: [_document(seed) for seed in range(10_001)],
            "has 10001 rows in 1 groups, which no campaign writes",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_a_file_takes_no_more_memory_than_rows_need(
    documents: Callable[[], list[dict[str, Any]]], told: str, tmp_path: Path
) -> None:
    path = _written(tmp_path, *documents())
    assert path.stat().st_size < 3 * MIB
    usual, pool = pa.default_memory_pool(), pa.system_memory_pool()
    pa.set_memory_pool(pool)
    try:
        assert _complaint(tmp_path).startswith(f"part-000001.parquet: {told}")
    finally:
        pa.set_memory_pool(usual)
    assert pool.max_memory() < 150 * MIB


def test_a_copy_is_told_and_other_files_are_left_alone(tmp_path: Path) -> None:
    part = _written(tmp_path, _document(0), _document(1))
    for name in ("rows.parquet", "part-000001 (copy).parquet", "part-1.parquet", "part-000001.parquet.bak"):
        shutil.copy(part, part.with_name(name))
    assert Results(tmp_path).parts == [part]
    assert [row.seed for row in Results(tmp_path).rows(range(10))] == [0, 1]
    shutil.copy(part, part.with_name("part-000002.parquet"))
    told = "part-000002.parquet: has the run of seed 0 once more: remove the file if it is a copy"
    assert _complaint(tmp_path) == told


@pytest.mark.skipif(os.name == "nt", reason="links need rights there, and there are no pipes")
def test_links_and_pipes_are_refused(tmp_path: Path) -> None:
    other = tmp_path / "other"
    other.mkdir()
    part = tmp_path / "rows" / "part-000001.parquet"
    _written(other, _document())
    part.parent.mkdir()
    part.symlink_to(other / "rows" / "part-000001.parquet")
    assert _complaint(tmp_path).startswith("part-000001.parquet: is no file of a campaign's rows: ")
    part.unlink()
    os.mkfifo(part)
    assert _complaint(tmp_path) == "part-000001.parquet: is no regular file"


def test_long_texts_are_cut_before_they_are_written(tmp_path: Path) -> None:
    results = Results(tmp_path)
    with results.writing():
        results.add([Row(0, "", "", "", Ended.CRASHED, "m" * 20_000, breaches=(Breach("program", "w" * 20_000),))])
    (row,) = Results(tmp_path).rows(range(1))
    assert (row.message, row.breaches[0].what) == ("m" * 10_000, "w" * 10_000)


def test_rows_beyond_the_runs_asked_for_do_not_count(tmp_path: Path) -> None:
    """Fewer runs than before may be asked for; a report tells of all that are there."""
    _written(tmp_path, *map(_document, range(8)))
    results = Results(tmp_path)
    assert [row.seed for row in results.rows(range(2, 5))] == [2, 3, 4]
    assert (results.runs_there(0), results.runs_there(3), results.runs_there(10)) == (8, 5, 0)
    assert (results.row(7) or Row(0, "", "", "", Ended.DONE)).seed == 7


@pytest.mark.slow
def test_a_campaign_continues_beside_others_files_and_tells_a_copy_before_its_runs(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Foreign files made the continued campaign fail after its runs, whose rows were lost."""
    file, out = tmp_path / "small.toml", tmp_path / "out"
    file.write_text(SMALL, encoding="utf-8")
    words = ["campaign", str(file), "--out", str(out), "--workers", "1", "--runs"]
    assert run_json(capsys, *words, "1")["runs"] == 1
    foreign = out / "rows" / "rows.parquet"
    foreign.write_bytes(b"of somebody else")
    assert run_json(capsys, *words, "2")["runs"] == 2
    assert foreign.read_bytes() == b"of somebody else"
    told = run_json(capsys, *words, "1")
    assert (told["runs"], told["planned"]) == (1, 1)
    shutil.copy(out / "rows" / "part-000001.parquet", out / "rows" / "part-000009.parquet")
    monkeypatch.setattr("steptwin.features.campaigns.workers.run_here", pytest.fail)
    refusal(capsys, *words, "3")
