"""Features are found by their entry points; one that is broken is told and harms no other."""

from collections.abc import Iterator
from importlib.metadata import EntryPoint, EntryPoints
from types import SimpleNamespace

import pytest

from steptwin.host.cli.app import run
from steptwin.host.common import features
from steptwin.host.common.errors import InputError
from steptwin.host.common.features import GROUP, Feature
from steptwin.host.robots import brought_text, read_robot
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


def test_the_options_of_a_feature_are_of_its_class() -> None:
    options = SimpleNamespace()
    feature = Feature(name="x", machine_options=lambda: SimpleNamespace)
    assert feature.options_in([1, options, SimpleNamespace()]) is options
    assert feature.options_in([1]) is None
    assert FIRST.options_in([options]) is None


def test_a_table_of_a_robot_file_that_no_feature_has() -> None:
    with refusing(InputError):
        read_robot(brought_text("corexy-gantry") + "\n[conveyor]\nspeed_mm_s = 20.0\n")
