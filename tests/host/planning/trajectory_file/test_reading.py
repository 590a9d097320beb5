"""Trajectory files: all accepted forms give the same motion; the error for each kind of mistake."""

import json
import tracemalloc
from collections.abc import Callable
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.host.common.errors import InputError
from steptwin.host.common.file_limits import CSV_BYTES_MAX, JSON_BYTES_MAX, LINE_CHARS_MAX
from steptwin.host.planning.motion import Motion
from steptwin.host.planning.trajectory_file import LONGEST_S, is_trajectory_file, read_trajectory
from steptwin.host.robots import load_robot
from tests.host.complaints import complaint_of

ROBOT = load_robot("teaching-scara")
NAMES = ROBOT.joint_names
HEADER = "t,th1,th2,d3,th4"
TIMES_S = [0.0, 0.5, 1.25]
POSITIONS = [[0.0, 0.0, 0.0, 0.0], [10.0, -5.0, 20.0, 1.5], [20.0, 0.0, 60.0, -3.0]]
VELOCITIES = [[0.0, 0.0, 0.0, 0.0], [20.0, 0.0, 40.0, -2.5], [0.0, 0.0, 0.0, 0.0]]

ROWS = ["0,0,0,0,0", "0.5,10,-5,20,1.5", "1.25,20,0,60,-3"]
CSV = "\n".join([HEADER, *ROWS, ""])
MOVING_CSV = (
    f"{HEADER},v_th1,v_th2,v_d3,v_th4\n0,0,0,0,0,0,0,0,0\n0.5,10,-5,20,1.5,20,0,40,-2.5\n1.25,20,0,60,-3,0,0,0,0\n"
)
DERIVED_CSV = "\n".join(
    f"{line},{extra}"
    for line, extra in zip(
        MOVING_CSV.splitlines(), ["a_d3,tool_phi,a_th1", "1,2,3", "not,even,numbers", "7,8,9"], strict=True
    )
)


def document(*, moving: bool = False, seconds: Callable[[float], Any] = float) -> dict[str, Any]:
    """Return the same motion as a JSON document."""
    points: list[dict[str, Any]] = [
        {"positions": list(row), "time_from_start": seconds(t_s)} for t_s, row in zip(TIMES_S, POSITIONS, strict=True)
    ]
    if moving:
        for point, row in zip(points, VELOCITIES, strict=True):
            point["velocities"] = list(row)
    return {"joint_names": list(NAMES), "points": points}


def in_parts(whole: str, billionths: str) -> Callable[[float], dict[str, int]]:
    return lambda t_s: {whole: int(t_s), billionths: round(t_s % 1 * 1e9)}


def reordered(made: dict[str, Any]) -> dict[str, Any]:
    made["joint_names"].reverse()
    for point in made["points"]:
        point["positions"].reverse()
        point.get("velocities", []).reverse()
    return made


def with_points(made: dict[str, Any], **entries: Any) -> dict[str, Any]:
    for point in made["points"]:
        point.update(entries)
    return made


def read(folder: Path, content: str | bytes, suffix: str = ".csv") -> Motion:
    file = folder / f"motion{suffix}"
    file.write_bytes(content if isinstance(content, bytes) else content.encode("utf-8"))
    return read_trajectory(str(file), ROBOT)


def complaint(folder: Path, content: str | bytes, suffix: str = ".csv") -> str:
    """Return the error for a file, without the file's name."""
    message = complaint_of(lambda: read(folder, content, suffix))
    file, separator, rest = message.partition(f"motion{suffix}: ")
    assert (file, bool(separator)) == (f"{folder}/", True)
    return rest


def assert_passes_through(motion: Motion) -> None:
    assert motion.joint_names == NAMES
    assert motion.duration_s == 1.25
    assert motion.positions(np.array(TIMES_S)) == pytest.approx(np.array(POSITIONS), abs=1e-12)
    assert motion.velocities(np.array([0.0, 1.25])) == pytest.approx(np.zeros((2, 4)), abs=1e-12)


POSITIONS_ONLY = [
    pytest.param(".csv", CSV, id="plain"),
    pytest.param(".CSV", CSV, id="capital suffix"),
    pytest.param(".csv", CSV.rstrip(), id="no newline at the end"),
    pytest.param(".csv", b"\xef\xbb\xbf" + CSV.encode(), id="BOM"),
    pytest.param(".csv", CSV.replace("\n", "\r\n"), id="CRLF"),
    pytest.param(".csv", CSV.replace("\n", "\r"), id="CR"),
    pytest.param(".csv", CSV.replace(",", " ,\t"), id="spaces"),
    pytest.param(".csv", CSV.replace("0.5,10,", '"5e-1","+1e1",'), id="quotes and exponents"),
    pytest.param(".csv", "# mm, deg\n\n" + CSV.replace("\n", "\n \n  # next\n"), id="comments and blank lines"),
    pytest.param(
        ".csv", CSV.replace("\n", "\n# one line\u2028still\x0cthe same\n"), id="other separators in a comment"
    ),
    pytest.param(".csv", "t,d3,th4,th1,th2\n0,0,0,0,0\n.5,20,1.5,10,-5\n1.25,60,-3,20,0", id="joints in another order"),
    pytest.param(".json", json.dumps(document()), id="JSON"),
    pytest.param(".Json", json.dumps(document(), indent=1).replace("\n", "\r\n"), id="JSON with CRLF"),
    pytest.param(".json", b"\xef\xbb\xbf" + json.dumps(document()).encode(), id="JSON with BOM"),
    pytest.param(".json", json.dumps(document(seconds=in_parts("sec", "nanosec"))), id="ROS 2 times"),
    pytest.param(".json", json.dumps(document(seconds=in_parts("secs", "nsecs"))), id="ROS 1 times"),
    pytest.param(".json", json.dumps(reordered(document())), id="JSON with joints in another order"),
    pytest.param(".json", json.dumps({"header": {"frame_id": ""}, **document()}), id="JSON with a header"),
    pytest.param(
        ".json",
        json.dumps(with_points(document(), velocities=[], accelerations=[], effort=[])),
        id="JSON with ROS' empty lists",
    ),
]


@pytest.mark.parametrize(("suffix", "content"), POSITIONS_ONLY)
def test_positions_only(suffix: str, content: str | bytes, tmp_path: Path) -> None:
    """The motion is a C2 spline from rest to rest: its acceleration does not jump at the middle point."""
    motion = read(tmp_path, content, suffix)
    assert_passes_through(motion)
    assert motion.breakpoints_s == ()
    velocities = motion.velocities(np.array([0.5 - 1e-6, 0.5, 0.5 + 1e-6]))
    assert np.diff(velocities, 2, axis=0) == pytest.approx(np.zeros((1, 4)), abs=1e-8)
    t_s = np.linspace(0.0, 1.25, 101)
    assert np.array_equal(motion.positions(t_s), read(tmp_path, CSV).positions(t_s))


@pytest.mark.parametrize(
    ("suffix", "content"),
    [
        pytest.param(".csv", MOVING_CSV, id="CSV"),
        pytest.param(".csv", DERIVED_CSV, id="CSV with columns that follow from the others"),
        pytest.param(
            ".csv",
            "t,v_d3,th1,th2,d3,th4,v_th1,v_th2,v_th4\n0,0,0,0,0,0,0,0,0\n"
            ".5,40,10,-5,20,1.5,20,0,-2.5\n1.25,0,20,0,60,-3,0,0,0",
            id="CSV in another order",
        ),
        pytest.param(".json", json.dumps(document(moving=True)), id="JSON"),
        pytest.param(".json", json.dumps(reordered(document(moving=True))), id="JSON in another order"),
    ],
)
def test_with_velocities(suffix: str, content: str, tmp_path: Path) -> None:
    motion = read(tmp_path, content, suffix)
    assert_passes_through(motion)
    assert motion.velocities(np.array(TIMES_S)) == pytest.approx(np.array(VELOCITIES), abs=1e-12)
    assert motion.breakpoints_s == (0.5,)


def test_positions_only_may_come_at_any_time(tmp_path: Path) -> None:
    """Only the last time must be a whole millisecond."""
    motion = read(tmp_path, CSV.replace("0.5,", "0.50004,"))
    assert motion.positions(np.array([0.50004]))[0] == pytest.approx(POSITIONS[1])


def test_the_longest(tmp_path: Path) -> None:
    assert read(tmp_path, CSV.replace("1.25,", f"{LONGEST_S},")).duration_s == LONGEST_S


@pytest.mark.parametrize(
    ("name", "is_file"),
    [
        ("a.csv", True),
        ("dir/a.JSON", True),
        ("a.yml", True),
        ("a.YAML", True),
        ("carry", False),
        ("a.csv.gz", False),
        ("csv", False),
        ("a.toml", False),
    ],
)
def test_which_names_are_files(name: str, is_file: bool) -> None:
    assert is_trajectory_file(name) is is_file


class TestMistakesInACsv:
    @pytest.mark.parametrize(
        "content",
        [
            pytest.param("", id="empty"),
            pytest.param("\n# nothing\n \n", id="comments only"),
            pytest.param(b"t,th1\n0,\xe4\n", id="Latin-1"),
            pytest.param(CSV.encode("utf-16"), id="UTF-16"),
            pytest.param(CSV.replace("t,", "time,", 1), id="time"),
            pytest.param("\n".join(ROWS), id="no header"),
            pytest.param(CSV.replace(",", ";"), id="semicolons"),
            pytest.param(CSV.replace("d3", "th1"), id="twice"),
            pytest.param(CSV.replace("th1", "t"), id="t twice"),
            pytest.param(CSV.replace("th4", "th"), id="unknown"),
            pytest.param(CSV.replace("d3", "z"), id="like no other"),
            pytest.param("t,th1,d3,th4\n0,0,0,0\n", id="missing"),
            pytest.param(f"{HEADER},\n0,0,0,0,0,\n", id="comma too many"),
            pytest.param(CSV.replace(",-5", ""), id="ragged"),
            pytest.param(f"#\n\n{CSV}9,9", id="ragged after a comment"),
            pytest.param(CSV.replace("-5", "five"), id="no number"),
            pytest.param(CSV.replace("-5", ""), id="nothing"),
            pytest.param(CSV.replace("-5", "true"), id="boolean"),
            pytest.param(CSV.replace("-5", "nan"), id="nan"),
            pytest.param(CSV.replace("-5", "-inf"), id="inf"),
            pytest.param(CSV.replace("-5", "-1e10"), id="-1e10"),
            pytest.param(CSV.replace("-5", "1e400"), id="1e400"),
            pytest.param(CSV.replace("0.5", "0.5_0"), id="an underscore"),
            pytest.param(CSV.replace("0.5", "０.５"), id="full-width digits"),
            pytest.param(CSV.replace("0.5", "nan"), id="not a number"),
            pytest.param(CSV.replace("0.5", "-inf"), id="infinite"),
            pytest.param(
                "t," + ",".join(f"j{i}" for i in range(35)),
                id="too many columns",
            ),
            pytest.param("t," * 30_000, id="a header of 30 000 columns"),
            pytest.param("#" * 8193, id="a long comment"),
            pytest.param(CSV.replace("0.5", "1e10"), id="time too large"),
            pytest.param(CSV.replace("-5", '"5\n6"'), id="a quoted field in two lines"),
            pytest.param(f"{CSV}2,0,0,0,{'9' * 200_000}", id="a very long field"),
            pytest.param(
                MOVING_CSV.replace(",v_th4", "").replace(",-2.5", ""),
                id="velocities of some joints",
            ),
            pytest.param(
                MOVING_CSV.replace("v_th4", "v_th5"),
                id="velocity of nobody",
            ),
            pytest.param(DERIVED_CSV.replace("v_", "u_"), id="accelerations without velocities"),
            pytest.param(DERIVED_CSV.replace(",numbers", ""), id="too short"),
            pytest.param(DERIVED_CSV.replace("a_d3", "a_d4"), id="of an unknown joint"),
            pytest.param(MOVING_CSV.replace(",-2.5", ","), id="of some points"),
        ],
    )
    def test_errors_name_the_line(self, content: str | bytes, tmp_path: Path) -> None:
        complaint(tmp_path, content)


class TestTimes:
    """Errors name the line in CSV and the point in JSON; the first point is in line 2."""

    @pytest.mark.parametrize(
        "times",
        [
            pytest.param(["-0.1", "0.5"], id="early"),
            pytest.param(["0", "1", "0.5"], id="back"),
            pytest.param(["0", "0.5", "0.5"], id="equal"),
            pytest.param(["0", "1e-300", "1"], id="almost equal"),
            pytest.param(["0", "100.0015"], id="end"),
            pytest.param(["0", "3600.001"], id="too long"),
            pytest.param(["0", "1e9"], id="nanoseconds"),
        ],
    )
    @pytest.mark.parametrize("suffix", [".csv", ".json"])
    def test_wrong_times_are_refused(self, times: list[str], suffix: str, tmp_path: Path) -> None:
        complaint(tmp_path, standing(times, suffix), suffix)

    def test_a_csv_begins_at_0_s(self, tmp_path: Path) -> None:
        complaint(tmp_path, standing(["0.1", "0.5"], ".csv"), ".csv")

    @pytest.mark.parametrize("times", [[], ["0"]], ids=str)
    @pytest.mark.parametrize("suffix", [".csv", ".json"])
    def test_too_few(self, times: list[str], suffix: str, tmp_path: Path) -> None:
        complaint(tmp_path, standing(times, suffix), suffix)

    def test_with_velocities_they_are_whole_ms(self, tmp_path: Path) -> None:
        words = "0.5001 s is not a whole number of milliseconds: the nearest is 0.5 s"
        assert complaint(tmp_path, MOVING_CSV.replace("0.5,", "0.5001,")) == f"line 3, t: {words}"
        made = json.dumps(at(document(moving=True), 1, time_from_start=0.5001))
        assert complaint(tmp_path, made, ".json") == f"point 2, time_from_start: {words}"


def standing(times: list[str], suffix: str) -> str:
    """Return a file in which the robot stands still."""
    if suffix == ".csv":
        return "\n".join([HEADER, *(f"{t},0,0,0,0" for t in times)])
    points = [{"positions": [0, 0, 0, 0], "time_from_start": float(t)} for t in times]
    return json.dumps({"joint_names": NAMES, "points": points})


def at(made: dict[str, Any], point: int, **entries: Any) -> dict[str, Any]:
    """Return the document with entries of one point changed; None removes an entry."""
    made["points"][point] |= entries
    made["points"][point] = {key: value for key, value in made["points"][point].items() if value is not None}
    return made


TEXT = json.dumps(document())


class TestMistakesInAJson:
    @pytest.mark.parametrize(
        "content",
        [
            pytest.param("", id="empty"),
            pytest.param(b"\xff\xfe", id="no UTF-8"),
            pytest.param(TEXT[:-1], id="cut"),
            pytest.param("[" * 100_000, id="depth bomb"),
            pytest.param("9" * 5000, id="integer bomb"),
            pytest.param("[]", id="a list"),
            pytest.param("{}", id="nothing"),
            pytest.param('{"joint_names": []}', id="no points"),
            pytest.param('{"points": {}, "joint_names": []}', id="points"),
            pytest.param('{"joint_names": [1], "points": []}', id="name"),
            pytest.param('{"joint_names": [], "points": []}', id="no names"),
            pytest.param(TEXT.replace("th4", "th5"), id="unknown"),
            pytest.param(TEXT.replace("th4", "th1"), id="twice"),
            pytest.param(
                TEXT.replace("joint_names", "names"),
                id="key",
            ),
            pytest.param(
                TEXT.replace("positions", "position"),
                id="key of a point",
            ),
            pytest.param('{"joint_names": [], "points": [3]}', id="point"),
            pytest.param(TEXT.replace("-5.0", "NaN"), id="NaN"),
            pytest.param(TEXT.replace("-5.0", "-Infinity"), id="infinity"),
            pytest.param(TEXT.replace("-5.0", "1e400"), id="1e400"),
            pytest.param(TEXT.replace("-5.0", "1" * 4000), id="4000 digits"),
            pytest.param(TEXT.replace("-5.0", "true"), id="boolean"),
            pytest.param(TEXT.replace("-5.0", '"5"'), id="string"),
            pytest.param(TEXT.replace("-5.0", "null"), id="null"),
            pytest.param(TEXT.replace("-5.0, ", ""), id="ragged"),
        ],
    )
    def test_errors_name_the_point(self, content: str | bytes, tmp_path: Path) -> None:
        complaint(tmp_path, content, ".json")

    @pytest.mark.parametrize(
        "made",
        [
            pytest.param(at(document(), 1, positions=None), id="positions"),
            pytest.param(at(document(), 2, time_from_start=None), id="time"),
            pytest.param(at(document(), 2, time_from_start="1"), id="time text"),
            pytest.param(
                at(document(), 2, time_from_start={"sec": 1, "nsec\n": 0}),
                id="keys of a time",
            ),
            pytest.param(
                at(document(), 2, time_from_start={"sec": 1, "nanosec": True}),
                id="nanoseconds",
            ),
            pytest.param(
                at(document(), 2, accelerations=[0, 0, 0]),
                id="accelerations",
            ),
            pytest.param(at(document(), 0, effort=[1]), id="effort"),
            pytest.param(
                at(document(moving=True), 1, velocities=None),
                id="velocities of some points",
            ),
            pytest.param(
                at(document(moving=True), 1, velocities=[1, 2, 3]),
                id="velocities of some joints",
            ),
            pytest.param(
                at(document(moving=True), 1, velocities=[1, 2, 3, False]),
                id="velocity",
            ),
        ],
    )
    def test_of_one_point(self, made: dict[str, Any], tmp_path: Path) -> None:
        complaint(tmp_path, json.dumps(made), ".json")

    def test_deep_nesting_can_be_shown_in_an_error(self, tmp_path: Path) -> None:
        """A document that the parser can just read must not be too deep for the message."""
        for depth in range(880, 1000):
            nested = f'{{"joint_names": [{"[" * depth}{"]" * depth}], "points": []}}'
            assert complaint(tmp_path, nested, ".json").startswith(("joint_names: [[[[[[", "is not JSON that can"))


@pytest.mark.parametrize(
    ("name", "words"),
    [("none.csv", "No such file or directory"), ("", "Is a directory"), ("a\0b.csv", "is not a file name: embedded")],
)
def test_a_file_that_cannot_be_read(name: str, words: str, tmp_path: Path) -> None:
    path = f"{tmp_path}/{name}"
    told = complaint_of(lambda: read_trajectory(path, ROBOT))
    assert told.startswith(f"{path}: {words}")


def read_or_refuse(content: bytes, suffix: str) -> None:
    with TemporaryDirectory() as folder:
        try:
            motion = read(Path(folder), content, suffix)
        except InputError as error:
            message = str(error)
            assert message.startswith(folder)
            assert len(message.splitlines()) == 1
            message.encode("utf-8")  # can be printed
        else:
            assert np.isfinite(motion.positions(np.linspace(0.0, motion.duration_s))).all()


@pytest.mark.slow
@given(content=st.binary() | st.text().map(lambda text: text.encode("utf-8", "replace")))
@pytest.mark.parametrize("suffix", [".csv", ".json"])
def test_any_bytes_give_a_motion_or_an_error(suffix: str, content: bytes) -> None:
    read_or_refuse(content, suffix)


FIELDS = st.sampled_from(["0", "0.5", "1", "-3", "1e-300", "1e9", "nan", "", '"', "#", "x", *HEADER.split(",")])


@pytest.mark.slow
@given(
    header=st.just(HEADER) | st.lists(FIELDS | st.text(max_size=3), max_size=6).map(",".join),
    rows=st.lists(st.lists(FIELDS, min_size=5, max_size=5) | st.lists(FIELDS, max_size=6), max_size=5),
)
def test_near_csv_gives_a_motion_or_an_error(header: str, rows: list[list[str]]) -> None:
    read_or_refuse("\n".join([header, *map(",".join, rows)]).encode(), ".csv")


@pytest.mark.slow
@given(
    times_s=st.lists(st.floats(0.0, 2.0) | st.sampled_from([0.001, 1.0, 1e9]), max_size=4).map(sorted),
    position=st.floats(-1e9, 1e9),
    velocity=st.none() | st.floats(-1e9, 1e9),
)
def test_any_numbers_give_a_finite_motion_or_an_error(
    times_s: list[float], position: float, velocity: float | None
) -> None:
    points = [
        {
            "time_from_start": t_s,
            "positions": [position * (-1) ** i] * 4,
            "velocities": [] if velocity is None else [velocity] * 4,
        }
        for i, t_s in enumerate([0.0, *times_s])
    ]
    read_or_refuse(json.dumps({"joint_names": NAMES, "points": points}).encode(), ".json")


LEAVES = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5) | st.sampled_from(NAMES)
KEYS = st.sampled_from(["joint_names", "points", "positions", "velocities", "time_from_start", "sec", "nanosec"])
VALUES = st.recursive(LEAVES, lambda inner: st.lists(inner, max_size=4) | st.dictionaries(KEYS | st.text(), inner))


@pytest.mark.slow
@given(
    entries=st.dictionaries(KEYS, VALUES, max_size=3),
    where=st.sampled_from(["document", "point", "position"]),
    value=VALUES,
)
def test_near_json_gives_a_motion_or_an_error(entries: dict[str, Any], where: str, value: object) -> None:
    made = document()
    if where == "document":
        made |= entries
    elif where == "point":
        made["points"][1] |= entries
    else:
        made["points"][1]["positions"][2] = value
    read_or_refuse(json.dumps(made).encode(), ".json")


class TestLimitsOnFiles:
    def test_of_points(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr("steptwin.host.planning.trajectory_file.csv_points.POINTS_MAX", 3)
        read(tmp_path, CSV)
        told = "line 5: is beyond 3 points, one each millisecond of an hour"
        assert complaint(tmp_path, f"{CSV}2,0,0,0,0\n") == told

    def test_of_the_length_of_a_line(self, tmp_path: Path) -> None:
        comment = "#" * (LINE_CHARS_MAX - 1)
        assert_passes_through(read(tmp_path, f"{comment}\n{CSV}"))
        assert complaint(tmp_path, f"#{comment}\n{CSV}") == "line 1: has more than 8192 characters"

    @pytest.mark.parametrize(
        ("suffix", "size_bytes"),
        [
            (".csv", CSV_BYTES_MAX),
            (".json", JSON_BYTES_MAX),
        ],
    )
    def test_of_bytes(self, suffix: str, size_bytes: int, tmp_path: Path) -> None:
        """The file is sparse; at its limit it would be read."""
        file = tmp_path / f"motion{suffix}"
        with file.open("wb") as opened:
            opened.truncate(size_bytes + 1)
        complaint_of(lambda: read_trajectory(str(file), ROBOT))

    def test_an_endless_file_is_not_read(self) -> None:
        told = "is no file but a pipe or a device, which is not read"
        for name in ("zero.csv", "zero.json"):
            path = Path(f"/dev/{name.split('.')[0]}")
            if not path.exists():
                pytest.skip("no endless file on this system")
            with TemporaryDirectory() as folder:
                link = Path(folder) / name
                link.symlink_to(path)
                assert told in complaint_of(partial(read_trajectory, str(link), ROBOT))

    @pytest.mark.slow
    def test_a_long_file_takes_little_more_memory_than_its_numbers(self, tmp_path: Path) -> None:
        """25 000 points of 5 numbers, the last one wrong: 1 MB of numbers."""
        rows = [f"{i / 1000},10.0000000000001,-5.0000000000001,20,{i}e-9\n" for i in range(25_000)]
        content = HEADER + "\n" + "".join(rows)
        tracemalloc.start()
        assert complaint(tmp_path, f"{content}x,0,0,0,0").startswith("line 25002, t: 'x' is not a number")
        peak_bytes = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert peak_bytes < 5 * 8 * 25_000 + 3 * len(content)
