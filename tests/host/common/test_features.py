"""Features are found by their entry points; one that is broken is told and harms no other."""

from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import EntryPoint, EntryPoints
from pathlib import Path
from types import SimpleNamespace

import pytest

from steptwin.host.cli.app import run
from steptwin.host.common import features
from steptwin.host.common.errors import InputError
from steptwin.host.common.features import GROUP, Feature
from steptwin.host.planning.jobs import Job, job_names, job_summary, make_job
from steptwin.host.planning.laws import Cubic
from steptwin.host.planning.motions.joint_move import joint_move
from steptwin.host.robots import MACHINES, brought_text, load_robot, read_robot, robot_names
from steptwin.host.robots.kinematics.kinds import kinds
from tests.messages import refused_with, refusing

FIRST, SECOND = Feature(name="first", report_lines=lambda _: []), Feature(name="second")


@pytest.fixture
def four_points(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Two features, and two entry points that lead nowhere."""
    there = f"{__name__}:FIRST", f"{__name__}:SECOND", "no_such_package:FEATURE", f"{__name__}:THIRD"
    points = EntryPoints(EntryPoint(name, value, GROUP) for name, value in zip("bacd", there, strict=True))
    monkeypatch.setattr(features, "entry_points", lambda *, group: points.select(group=group))
    features.registered.cache_clear()
    yield
    monkeypatch.undo()
    features.registered.cache_clear()


@pytest.mark.usefixtures("four_points")
def test_they_are_found_in_the_order_of_their_names() -> None:
    assert list(features.features().values()) == [SECOND, FIRST]
    assert features.giving("report_lines") == [(FIRST, FIRST.report_lines)]
    assert [refused_with(reason) for reason in features.broken_features().values()]


@pytest.mark.usefixtures("four_points")
def test_a_broken_one_is_told_by_each_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["jobs", "corexy-gantry"]) == 0
    told = capsys.readouterr().err.splitlines()
    assert [line.split(" of ")[0] for line in told] == ["steptwin: feature c", "steptwin: feature d"]


@pytest.mark.usefixtures("four_points")
def test_without_features_there_are_the_robots_of_the_core(capsys: pytest.CaptureFixture[str]) -> None:
    assert robot_names() == MACHINES == ("ar4-mk3", "corexy-gantry", "parol6", "thor", "turntable")
    assert list(kinds()) == ["scara", "cartesian", "axes", "chain"]
    assert job_names(load_robot("ar4-mk3")) == ()
    assert run(["robots"]) == 0
    assert "papers" not in capsys.readouterr().out


def test_the_robots_of_a_feature(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = brought_text("turntable").replace('name = "turntable"', 'name = "dividing-head"')
    (tmp_path / "dividing-head.toml").write_text(text, encoding="utf-8")
    monkeypatch.setattr("steptwin.host.robots.giving", lambda _: [(FIRST, tmp_path)])
    assert robot_names() == ("dividing-head", *MACHINES)
    monkeypatch.undo()
    assert "dividing-head" not in robot_names()


def test_of_two_jobs_with_one_name_the_later_feature_s_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its jobs come first."""

    @dataclass(frozen=True)
    class NoOptions:
        pass

    def job(name: str, summary: str) -> Job[NoOptions]:
        return Job(
            name, summary, NoOptions, lambda robot, _: joint_move(robot.joint_names, (0.0,), (9.0,), Cubic(1.0, 2.0))
        )

    first = {"axes": (job("spin", "once"), job("swing", "once"))}
    second = {"axes": (job("turn", "twice"), job("spin", "twice")), "scara": (job("wave", "twice"),)}
    given = [(FIRST, lambda: first), (SECOND, lambda: second)]
    monkeypatch.setattr("steptwin.host.planning.jobs.giving", lambda _: given)
    table = load_robot("turntable")
    assert {name: job_summary(table, name) for name in job_names(table)} == {
        "turn": "twice",
        "spin": "twice",
        "swing": "once",
    }
    assert make_job(table, "swing").duration_s == 2.0


def test_the_options_of_a_feature_are_of_its_class() -> None:
    options = SimpleNamespace()
    feature = Feature(name="x", machine_options=lambda: SimpleNamespace)
    assert feature.options_in([1, options, SimpleNamespace()]) is options
    assert feature.options_in([1]) is None
    assert FIRST.options_in([options]) is None


def test_a_table_of_a_robot_file_that_no_feature_has() -> None:
    with refusing(InputError):
        read_robot(brought_text("corexy-gantry") + "\n[conveyor]\nspeed_mm_s = 20.0\n")
