"""Robot files: the figures of the one that comes along, and what each kind of mistake in a file is told."""

from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from host.errors import InputError
from host.robot import MICROSTEPS, Joint, Transmission, Unit
from host.robots import load_robot, parse_robot, robot_names

NAME = "warehouse-scara"
TEXT = (files("host.robots") / f"{NAME}.toml").read_text(encoding="utf-8")
ROBOT = load_robot(NAME)


def complaint(text: str) -> str:
    with pytest.raises(InputError) as caught:
        parse_robot(text, "mine.toml")
    assert "\n" not in str(caught.value)
    return str(caught.value)


def changed(old: str, new: str) -> str:
    """The file with the first occurrence of a line's beginning replaced."""
    assert old in TEXT
    return TEXT.replace(old, new, 1)


def test_the_robot_that_comes_along() -> None:
    assert NAME in robot_names()
    assert ROBOT.name == NAME
    assert ROBOT.joint_names == ("sx", "sz", "L1", "th1", "th2", "th3")
    assert ROBOT.geometry == {"L2_mm": 200, "L3_mm": 150, "L4_mm": 40, "L5_mm": 40}
    assert ROBOT.home == (0, 0, 100, 0, 60, 30)


@pytest.mark.parametrize(
    ("name", "unit", "lower", "upper", "speed", "acceleration", "steps_per_unit", "rate_hz"),
    [
        ("sx", "mm", 0, 2000, 300, 500, 40, 12_000),
        ("sz", "mm", 0, 1000, 80, 300, 160, 12_800),
        ("L1", "mm", 50, 200, 40, 200, 320, 12_800),
        ("th1", "deg", -120, 120, 120, 720, 400 / 9, 16_000 / 3),
        ("th2", "deg", -150, 150, 120, 720, 400 / 9, 16_000 / 3),
        ("th3", "deg", -180, 180, 120, 720, 80 / 3, 3200),
    ],
)
def test_its_joints(
    name: str,
    unit: str,
    lower: float,
    upper: float,
    speed: float,
    acceleration: float,
    steps_per_unit: float,
    rate_hz: float,
) -> None:
    joint = ROBOT.joint(name)
    assert joint.unit == unit
    assert (joint.lower, joint.upper) == (lower, upper)
    assert (joint.speed_max, joint.acceleration_max) == (speed, acceleration)
    assert joint.transmission.steps_per_unit == steps_per_unit  # to the last bit
    assert joint.step_rate_max_hz == pytest.approx(rate_hz)


def test_its_pulses_are_exactly_15_khz() -> None:
    """Each time is rounded up to counts of 72 MHz."""
    board = ROBOT.board
    counts = [-(-ns * 72 // 1000) for ns in (board.steplen_ns, board.stepspace_ns)]
    assert sum(counts) == 4800
    assert 72_000_000 / sum(counts) == board.step_rate_max_hz == 15_000
    assert board.steplen_ns == 1.1 * 30_000  # 10 % above what the chip asks for at 330 pF
    assert (board.osc_pf, board.bitrate) == (330, 1_000_000)
    assert (board.dirsetup_ns, board.dirhold_ns) == (15_000, 15_000)


class TestTransmissions:
    @pytest.mark.parametrize("microsteps", MICROSTEPS)
    def test_wire_units_do_not_depend_on_microsteps(self, microsteps: int) -> None:
        transmission = Transmission(200, microsteps, 360.0, 5.0)
        assert transmission.wire_units_per_unit == 200 * 5 * 16384 / 360
        assert transmission.steps_per_unit == 200 * microsteps * 5 / 360
        assert transmission.travel_per_rev == 72.0

    @pytest.mark.parametrize("microsteps", [0, 3, 4, 32, -1])
    def test_the_driver_has_no_other_microsteps(self, microsteps: int) -> None:
        with pytest.raises(InputError, match=rf"microsteps: {microsteps} is none of the TB6560's \(1, 2, 8, 16\)"):
            Transmission(200, microsteps, 10.0)

    def test_the_wire_ends_at_131_072_full_steps(self) -> None:
        """655.36 turns of 200 full steps, less one unit: 6553.6 mm with a lead of 10 mm."""
        screw = Transmission(200, 8, 10.0)
        assert Joint("z", Unit.MM, -6553.5, 6553.5, 80, 300, screw).upper == 6553.5
        with pytest.raises(InputError, match=r"upper: 6553.7 mm from zero is beyond the wire's 6553.6 mm"):
            Joint("z", Unit.MM, 0, 6553.7, 80, 300, screw)
        with pytest.raises(InputError, match=r"lower: 6553.7 mm from zero"):
            Joint("z", Unit.MM, -6553.7, 0, 80, 300, screw)


def test_home_is_within_limits() -> None:
    home = np.array(ROBOT.home)
    assert np.all(home >= [joint.lower for joint in ROBOT.joints])
    assert np.all(home <= [joint.upper for joint in ROBOT.joints])


class TestMistakesInAFile:
    @pytest.mark.parametrize(
        ("old", "new", "words"),
        [
            pytest.param("microsteps = 16", "microsteps = 4", "joints.th1.microsteps: 4 is none of", id="microsteps"),
            pytest.param("ratio = 5.0", "", "joints.th1.ratio: is missing", id="missing"),
            pytest.param("ratio = 5.0", "ratio = 0", "joints.th1.ratio: 0 is not above 0", id="zero"),
            pytest.param("ratio = 5.0", "ratio = nan", "joints.th1.ratio: nan is not a finite", id="nan"),
            pytest.param("ratio = 5.0", "ratio = true", "joints.th1.ratio: True is not a finite", id="boolean"),
            pytest.param("ratio = 5.0", 'ratio = "5"', "joints.th1.ratio: '5' is not a finite number", id="text"),
            pytest.param("ratio = 5.0", "ratoi = 5.0", "joints.th1.ratio: is missing", id="mistyped"),
            pytest.param(
                "ratio = 5.0",
                "ratio = 5.0\nmicrostep = 8",
                "joints.th1.microstep: key 'microstep' is unknown: did you mean microsteps?",
                id="unknown",
            ),
            pytest.param("microsteps = 8", "microsteps = 8.0", "joints.sx.microsteps: 8.0 is not a whole", id="float"),
            pytest.param(
                "travel_per_turn = 10.0", "travel_per_turn = -1", "joints.sz.travel_per_turn: -1 is", id="lead"
            ),
            pytest.param('unit = "deg"', 'unit = "rad"', "joints.th1.unit: 'rad' is none of mm, deg", id="unit"),
            pytest.param(
                "upper = 2000.0", "upper = 0.0", "joints.sx.upper: 0 mm is not above lower, 0 mm", id="limits"
            ),
            pytest.param("speed_max = 80.0", "speed_max = 0", "joints.sz.speed_max: 0 is not above 0", id="speed"),
            pytest.param(
                "acceleration_max = 720.0",
                "acceleration_max = -1",
                "joints.th1.acceleration_max: -1 is not above 0",
                id="acceleration",
            ),
            pytest.param("osc_pf = 330", "osc_pf = 0", "board.osc_pf: 0 is not above 0", id="board"),
            pytest.param("1_000_000", "800_000", "board.bitrate: 800000 is none of 125000, 250000", id="bit rate"),
            pytest.param("33_000", "3_999", "board.steplen_ns: 3999 ns is outside 4000..1000000 ns", id="steplen"),
            pytest.param("15_000", "1_000_001", "board.dirsetup_ns: 1000001 ns is outside 0..1000000", id="dirsetup"),
            pytest.param(
                "bitrate = 1_000_000", "bitrate = 1e6", "board.bitrate: 1000000.0 is not a whole", id="bitrate"
            ),
            pytest.param(
                "steplen_ns = 33_000",
                "steplen_ns = 33_002",
                "board.step_rate_max_hz: 15000 Hz is more than the 14999.7 Hz that",
                id="pulses too long",
            ),
            pytest.param("L2_mm = 200.0", "L2_mm = []", "kinematics.L2_mm: [] is not a finite", id="dimension"),
            pytest.param("L2_mm = 200.0", "", "kinematics.L2_mm: is missing", id="missing dimension"),
            pytest.param(
                'kind = "warehouse-scara"',
                'kind = "warehouse"',
                "kinematics.kind: 'warehouse' is unknown: did you mean warehouse-scara?",
                id="kind",
            ),
            pytest.param('name = "warehouse-scara"', "name = 1", "name: 1 is not a text", id="name"),
            pytest.param("th2 = 60.0", "th2 = 151", "home.th2: 151 deg is outside -150..150 deg", id="home"),
            pytest.param("th2 = 60.0", "", "home.th2: is missing", id="missing home"),
            pytest.param("th2 = 60.0", "th2 = 60.0\nth4 = 0", "home.th4: key 'th4' is unknown", id="home of nobody"),
            pytest.param("[board]", "[bord]", "board: is missing", id="section"),
            pytest.param("[joints.th3]", "[joints.th4]", "home.th3: key 'th3' is unknown", id="other joint"),
            pytest.param("[kinematics]", "[kinematics", "is not TOML: ", id="no TOML"),
            pytest.param('name = "warehouse-scara"', 'colour = 1\nname = "x"', "colour: key 'colour' is", id="top"),
        ],
    )
    def test_is_told_with_its_key(self, old: str, new: str, words: str) -> None:
        text = changed(old, new)
        if words == "home.th3: key 'th3' is unknown":
            text = text.replace("th3 = 30.0 # [S]\n", "th3 = 30.0 # [S]\nth4 = 0.0\n")
        assert complaint(text).startswith(f"mine.toml: {words}")

    def test_a_table_that_is_none(self) -> None:
        head = TEXT[: TEXT.index("[kinematics]")]
        assert complaint(f"{head}kinematics = 3\n").startswith("mine.toml: kinematics: 3 is not a table")
        rest = TEXT[TEXT.index("[board]") : TEXT.index("[joints.sx]")]
        robot = f'{head}[kinematics]\nkind = "warehouse-scara"\n{rest}'
        assert complaint(f"{robot}[joints]\nsx = 1\n").startswith("mine.toml: joints.sx: 1 is not a table")
        assert complaint(f"{robot}[joints]\n[home]\n") == "mine.toml: joints: 0 of them, a board drives 1 to 8"

    def test_a_speed_that_the_driver_cannot_follow(self) -> None:
        """75 mm/s at a lead of 8 mm and 1/8 step is exactly 15 kHz."""
        lead = changed("travel_per_turn = 10.0", "travel_per_turn = 8.0")
        fast = parse_robot(lead.replace("speed_max = 80.0", "speed_max = 75.0"), "mine.toml")
        assert fast.joint("sz").step_rate_max_hz == 15_000
        assert complaint(lead) == (
            "mine.toml: joints.sz.speed_max: 80 mm/s takes 16.0 kHz of steps, more than the driver's 15.0 kHz"
        )


class TestLoading:
    def test_an_unknown_name_offers_the_nearest(self) -> None:
        with pytest.raises(InputError, match=r"^robot 'warehouse-skara' is unknown: did you mean warehouse-scara\?$"):
            load_robot("warehouse-skara")

    def test_a_name_like_none_offers_all(self) -> None:
        with pytest.raises(InputError, match=r"^robot 'zzz' is unknown: there are .*warehouse-scara"):
            load_robot("zzz")

    def test_a_file_of_ones_own(self, tmp_path: Path) -> None:
        file = tmp_path / "mine.toml"
        file.write_text(changed('name = "warehouse-scara"', 'name = "mine"'), encoding="utf-8")
        assert load_robot(str(file)).name == "mine"

    def test_a_file_that_cannot_be_read(self, tmp_path: Path) -> None:
        with pytest.raises(InputError, match=r"none.toml: No such file"):
            load_robot(str(tmp_path / "none.toml"))
        (tmp_path / "latin.toml").write_bytes(b"# \xe4\n")
        with pytest.raises(InputError, match=r"latin.toml: is not UTF-8"):
            load_robot(str(tmp_path / "latin.toml"))
