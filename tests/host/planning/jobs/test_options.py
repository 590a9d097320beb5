"""A job's options: reading texts into a dataclass, and the error for each kind of mistake."""

import dataclasses
from dataclasses import dataclass
from enum import Enum

import pytest

from steptwin.host.common.errors import InputError
from steptwin.host.planning.jobs import job_names, job_options, make_job
from steptwin.host.planning.jobs.options import (
    describe_options,
    joint_position,
    number,
    parse_options,
    place,
)
from steptwin.host.robots import load_robot, robot_names
from steptwin.host.robots.switches import JointSwitches
from tests.host.complaints import complaint_of
from tests.messages import refusing

ROBOT = load_robot("warehouse-scara")


class Side(Enum):
    """An enum with a hyphen in a value."""

    RIGHT = "right"
    FAR_LEFT = "far-left"


@dataclass(frozen=True, slots=True)
class Options:
    """One option of each kind."""

    side: Side = Side.RIGHT
    slot: str = place("A1", lambda robot: [name for name in robot.places if name[1:].isdigit()])
    pause_s: float = number(0.5, 0.001, 60.0, "s")
    angle_deg: float = number(0.0, -180.0, 180.0, "deg")
    repetitions: int = number(1, 1, 1000, "times")
    L1_mm: float = joint_position(100.0, "L1")


@pytest.mark.parametrize(
    ("name", "text", "field", "value"),
    [
        ("side", "right", "side", Side.RIGHT),
        ("side", "far-left", "side", Side.FAR_LEFT),
        ("slot", "B2", "slot", "B2"),
        ("pause_s", "0.25", "pause_s", 0.25),
        ("pause-s", "0.25", "pause_s", 0.25),
        ("pause_s", " 2.5e-1 ", "pause_s", 0.25),
        ("pause_s", "0.001", "pause_s", 0.001),
        ("pause_s", "60", "pause_s", 60.0),
        ("angle-deg", "-180", "angle_deg", -180.0),
        ("angle_deg", "+180.0", "angle_deg", 180.0),
        ("repetitions", "1", "repetitions", 1),
        ("repetitions", "1000", "repetitions", 1000),
        ("repetitions", "2.0", "repetitions", 2),
        ("L1_mm", "50", "L1_mm", 50.0),
        ("L1-mm", "200", "L1_mm", 200.0),
    ],
)
def test_a_text_becomes_a_value(name: str, text: str, field: str, value: object) -> None:
    options = parse_options(Options, {name: text}, ROBOT)
    assert options == dataclasses.replace(Options(), **{field: value})  # type: ignore[arg-type]
    assert type(getattr(options, field)) is type(value)


def test_no_options_and_all_options() -> None:
    assert parse_options(Options, {}, ROBOT) == Options()
    texts = {"side": "far-left", "slot": "A2", "pause-s": "1", "angle-deg": "2", "repetitions": "3", "L1-mm": "60"}
    assert parse_options(Options, texts, ROBOT) == Options(Side.FAR_LEFT, "A2", 1.0, 2.0, 3, 60.0)


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("side", "left", "option side: 'left' is unknown: did you mean far-left? (valid: right, far-left)"),
        ("side", "far_left", "option side: 'far_left' is unknown: did you mean far-left?"),
        ("side", "RIGHT", "option side: 'RIGHT' is unknown: did you mean right? (valid: "),
        ("side", "", "option side: '' is unknown: there are right, far-left"),
        ("slot", "A3", "option slot: 'A3' is unknown: there are A1, A2, B1, B2"),
        ("slot", "hand-over", "option slot: 'hand-over' is unknown: there are A1, A2, B1, B2"),
        ("pause_s", "soon", "option pause_s: 'soon' is not a number (valid: 0.001..60 s)"),
        ("pause-s", "", "option pause_s: '' is not a number"),
        ("pause_s", "1,5", "option pause_s: '1,5' is not a number"),
        ("pause_s", "0.0009", "option pause_s: 0.0009 s is outside 0.001..60 s"),
        ("pause_s", "60.0001", "option pause_s: 60.0001 s is outside 0.001..60 s"),
        ("pause_s", "nan", "option pause_s: nan s is outside 0.001..60 s"),
        ("pause_s", "1e400", "option pause_s: inf s is outside 0.001..60 s"),
        ("angle_deg", "-180.001", "option angle_deg: -180.001 deg is outside -180..180 deg"),
        ("angle_deg", "180.001", "option angle_deg: 180.001 deg is outside -180..180 deg"),
        ("repetitions", "0", "option repetitions: 0 times is outside 1..1000 times"),
        ("repetitions", "1001", "option repetitions: 1001 times is outside 1..1000 times"),
        ("repetitions", "2.5", "option repetitions: 2.5 is not a whole number"),
        ("repetitions", "inf", "option repetitions: inf times is outside"),
        ("L1_mm", "49.999", "option L1_mm: 49.999 mm is outside 50..200 mm"),
        ("L1_mm", "200.001", "option L1_mm: 200.001 mm is outside 50..200 mm"),
        ("pause_ms", "1", "option 'pause_ms' is unknown: did you mean pause_s?"),
        ("l1-mm", "60", "option 'l1_mm' is unknown: did you mean L1_mm?"),
        ("", "1", "option '' is unknown: there are side, slot, pause_s, angle_deg, repetitions, L1_mm"),
        ("zzz", "1", "option 'zzz' is unknown: there are side, slot, pause_s, angle_deg, repetitions, L1_mm"),
    ],
)
def test_a_mistake_is_reported(name: str, text: str, words: str) -> None:
    told = complaint_of(lambda: parse_options(Options, {name: text}, ROBOT))
    assert told.startswith(words)


def test_the_range_of_a_joint_is_the_robots() -> None:
    lift = dataclasses.replace(ROBOT.joint("L1"), upper=300.0, switches=JointSwitches(), homing=None)
    taller = dataclasses.replace(ROBOT, joints=tuple(lift if joint.name == "L1" else joint for joint in ROBOT.joints))
    assert parse_options(Options, {"L1_mm": "300"}, taller).L1_mm == 300.0
    assert describe_options(Options, taller)["L1_mm"] == "100 (50..300 mm)"


@pytest.mark.parametrize("places", [{}, {"B1": {"sx": 1.0}}])
def test_a_default_place_must_exist(places: dict[str, dict[str, float]]) -> None:
    """The default is set by the job, the places by the robot file, so they may not match."""
    robot = dataclasses.replace(ROBOT, places=places, sections={})
    with refusing(InputError):
        parse_options(Options, {}, robot)


def test_a_default_place_may_be_missing_if_another_is_chosen() -> None:
    robot = dataclasses.replace(ROBOT, places={"B1": {"sx": 1.0}}, sections={})
    assert parse_options(Options, {"slot": "B1"}, robot).slot == "B1"


def test_descriptions() -> None:
    assert describe_options(Options, ROBOT) == {
        "side": "right (right, far-left)",
        "slot": "A1 (A1, A2, B1, B2)",
        "pause_s": "0.5 (0.001..60 s)",
        "angle_deg": "0 (-180..180 deg)",
        "repetitions": "1 (1..1000 times)",
        "L1_mm": "100 (50..200 mm)",
    }


JOBS = [
    pytest.param(robot, job, marks=pytest.mark.slow if job == "every-slot" else ())
    for robot in robot_names()
    for job in job_names(load_robot(robot))
]


@pytest.mark.parametrize(("robot_name", "job"), JOBS)
def test_the_defaults_of_each_job_are_valid_themselves(robot_name: str, job: str) -> None:
    robot = load_robot(robot_name)
    texts = {name: text.partition(" (")[0] for name, text in job_options(robot, job).items()}
    assert make_job(robot, job, texts).duration_s == make_job(robot, job, {}).duration_s


def test_an_unknown_job_offers_those_of_the_robot() -> None:
    with refusing(InputError):
        make_job(ROBOT, "carry", {})


class TestLaw:
    """Every job has the fastest law beside its own."""

    def test_jobs_without_and_with_a_law_of_their_own(self) -> None:
        teaching = load_robot("teaching-scara")
        assert job_options(ROBOT, "drawer-pull")["law"] == "planned (planned, fastest)"
        assert job_options(teaching, "carry")["law"] == "cubic (cubic, quintic, fastest)"
        planned = make_job(ROBOT, "drawer-pull", {"law": "planned"})
        assert planned.duration_s == make_job(ROBOT, "drawer-pull").duration_s
        for robot, job in ((ROBOT, "drawer-pull"), (teaching, "carry")):
            assert make_job(robot, job, {"law": "fastest"}).duration_s < 0.85 * make_job(robot, job).duration_s

    def test_a_form_that_sends_the_default_time_asks_for_nothing(self) -> None:
        options = {"law": "fastest", "duration_s": "10.0", "ramp_s": "2"}
        assert make_job(ROBOT, "pull-line", options).duration_s < 9.0

    @pytest.mark.parametrize(
        ("job", "options"),
        [
            ("drawer-pull", {"law": "cubic"}),
            ("drawer-pull", {"law": "fastes"}),
            ("pull-line", {"law": "fastest", "duration_s": "9"}),
            ("pull-line", {"law": "fastest", "duration_s": "x"}),
            ("pull-line", {"law": "fastest", "ramp-s": "2.5"}),
        ],
    )
    def test_each_mistake(self, job: str, options: dict[str, str]) -> None:
        complaint_of(lambda: make_job(ROBOT, job, options))
