"""Robot files: the figures of the robots that StepTwin brings, and the error for each kind of mistake in a file."""

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.emulator.drivers.driver import Driver
from steptwin.host.common.errors import InputError
from steptwin.host.robots import MACHINES, brought_text, load_robot, load_robot_file, parse_robot, robot_names
from steptwin.host.robots.board_settings import Output
from steptwin.host.robots.joint import Joint, Transmission, Unit
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.machine.boards import board_configs
from steptwin.protocol.drivers import ActiveEdge
from tests.emulator.pins import POWER_UP, pins
from tests.host.complaints import complaint_of
from tests.messages import refusing

NAME = "warehouse-scara"
TEXT = brought_text(NAME)
ROBOT = load_robot(NAME)


def complaint(text: str) -> str:
    return complaint_of(lambda: parse_robot(text, "mine.toml"))


def changed(old: str, new: str) -> str:
    """Return the file with the first occurrence of a text replaced."""
    assert old in TEXT
    return TEXT.replace(old, new, 1)


def test_the_warehouse_robot() -> None:
    assert NAME in robot_names()
    assert ROBOT.name == NAME
    assert ROBOT.joint_names == ("sx", "sz", "L1", "th1", "th2", "th3")
    assert ROBOT.geometry == {"L2_mm": 200, "L3_mm": 150, "L4_mm": 40, "L5_mm": 40}
    assert ROBOT.home == (0, 0, 100, 0, 60, 30)


FIGURES = """
    robot             joint unit  spu         per_pulse  v_max  clk_hz   rpm    lower  upper  a_max
    lab-scara         d1    mm    80          0.0125     140    11200.0  420    0      250    500
    lab-scara         th2   deg   44.444444   0.0225     130    5777.8   108.3  -150   150    1500
    lab-scara         th3   deg   44.444444   0.0225     130    5777.8   108.3  -130   130    1500
    lab-scara         th4   deg   8.888889    0.1125     130    1155.6   21.7   -360   360    1500
    warehouse-scara   sx    mm    40          0.025      300    12000.0  450    0      2000   500
    warehouse-scara   sz    mm    160         0.00625    80     12800.0  480    0      1000   300
    warehouse-scara   L1    mm    320         0.003125   40     12800.0  480    50     200    200
    warehouse-scara   th1   deg   44.444444   0.0225     120    5333.3   100    -120   120    720
    warehouse-scara   th2   deg   44.444444   0.0225     120    5333.3   100    -150   150    720
    warehouse-scara   th3   deg   26.666667   0.0375     120    3200.0   60     -180   180    720
    teaching-scara    th1   deg   35.555556   0.028125   180    6400.0   120    -130   130    1000
    teaching-scara    th2   deg   35.555556   0.028125   180    6400.0   120    -150   150    1000
    teaching-scara    d3    mm    320         0.003125   40     12800.0  480    0      60     200
    teaching-scara    th4   deg   17.777778   0.05625    360    6400.0   120    -360   360    2000
    calibration-scara th1   deg   44.444444   0.0225     180    8000.0   150    -130   130    1000
    calibration-scara th2   deg   44.444444   0.0225     180    8000.0   150    -145   145    1000
    calibration-scara d3    mm    160         0.00625    80     12800.0  480    0      200    300
    calibration-scara th4   deg   17.777778   0.05625    360    6400.0   120    -360   360    2000
    hybrid-arm        th1   deg   44.444444   0.0225     90     4000.0   75     -170   170    500
    hybrid-arm        Z5    mm    160         0.00625    80     12800.0  480    -250   250    400
    hybrid-arm        Z6    mm    160         0.00625    80     12800.0  480    -250   250    400
    hybrid-arm        th4   deg   8.888889    0.1125     180    1600.0   30     -360   360    1000
    ar4-mk3           J1    deg   88.888889   0.01125    60     5333.3   400    -170   170    30
    ar4-mk3           J2    deg   111.111111  0.009      60     6666.7   500    -42    90     30
    ar4-mk3           J3    deg   111.111111  0.009      60     6666.7   500    -89    52     30
    ar4-mk3           J4    deg   99.555556   0.010044642857142856 60     5973.3   448    -180   180    30
    ar4-mk3           J5    deg   43.72       0.022872827081427266 60     2623.2   98.37  -105   105    30
    ar4-mk3           J6    deg   44.444444   0.0225     60     2666.7   200    -180   180    30
    parol6            J1    deg   113.777778  0.0087890625 131.835 14999.9 140.6 -123.046875 123.046875 395.5
    parol6            J2    deg   355.555556  0.0028125  70.312 24999.8  234.4  -145.0088 -3.375 210.93
    parol6            J3    deg   321.693122  0.0031085526315789477 99.473 31999.8 300 107.866 287.8675 298.42
    parol6            J4    deg   71.111111   0.0140625  140.625 10000.0 93.75  -105.46975 105.46975 421.87
    parol6            J5    deg   71.111111   0.0140625  140.625 10000.0 93.75  -90    90     421.87
    parol6            J6    deg   177.777778  0.005625   151.875 27000.0 253.13 0      360    455.62
    thor              J1    deg   44.444444   0.0225     33.2   1475.6   27.67  -170   170    60
    thor              J2    deg   276.363636  0.003618421052631579 13.1 3620.4   67.88  -90    90     60
    thor              J3    deg   276.363636  0.003618421052631579 13.1 3620.4   67.88  -90    90     60
    thor              J4    deg   17.777778   0.05625    33.2   590.2    11.07  -170   170    60
    thor              J5    deg   17.777778   0.05625    83     4426.7   27.67  -90    90     60
    thor              J6    deg   17.777778   0.05625    83     4426.7   27.67  -170   170    60
    corexy-gantry     X     mm    80          0.0125     350    28000.0  525    0      250    3000
    corexy-gantry     Y     mm    80          0.0125     350    28000.0  525    0      250    3000
    corexy-gantry     Z     mm    400         0.0025     50     20000.0  375    0      250    350
    turntable         table deg   500         0.002      20     10000.0  300    -180   180    40
"""
"""Steps per mm or degree, travel per pulse, highest speed with its step rate and motor speed, range, acceleration."""

MACHINES_KINDS = {
    "ar4-mk3": "chain",
    "corexy-gantry": "cartesian",
    "parol6": "chain",
    "thor": "chain",
    "turntable": "axes",
}
ROWS = [line.split() for line in FIGURES.splitlines()[2:]]


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row[0]} {row[1]}")
def test_figures(row: list[str]) -> None:
    robot, name, unit, *texts = row
    spu, per_pulse, speed, clk_hz, rpm, lower, upper, acceleration = map(float, texts)
    joint = load_robot(robot).joint(name)
    transmission = joint.transmission
    assert joint.unit == unit
    assert (joint.lower, joint.upper, joint.speed_max, joint.acceleration_max) == (lower, upper, speed, acceleration)
    assert transmission.steps_per_unit == pytest.approx(spu, abs=5e-7)
    assert 1 / transmission.steps_per_unit == pytest.approx(per_pulse, rel=1e-15)
    assert joint.step_rate_max_hz == pytest.approx(clk_hz, abs=0.05)
    assert 60 * speed / transmission.travel_per_rev == pytest.approx(rpm, abs=0.05)
    assert transmission.full_steps_per_rev == 200


def test_steps_per_unit_are_right_to_the_last_bit() -> None:
    assert [*ROBOT.steps_per_unit] == [40, 160, 320, 400 / 9, 400 / 9, 80 / 3]


class TestEachRobot:
    @pytest.fixture(params=robot_names())
    def robot(self, request: pytest.FixtureRequest) -> Robot:
        return load_robot(request.param)

    def test_is_in_the_table(self, robot: Robot) -> None:
        assert [joint for name, joint, *_ in ROWS if name == robot.name] == [*robot.joint_names]
        assert robot.kinematics == (MACHINES_KINDS[robot.name] if robot.name in MACHINES else robot.name)
        assert robot.title

    @pytest.mark.parametrize("name", [name for name in robot_names() if name not in MACHINES])
    def test_makes_pulses_of_exactly_15_khz(self, name: str) -> None:
        """Both times of a pulse are rounded up to counts of 72 MHz; the papers' robots have TB6560s."""
        board = load_robot(name).board
        counts = [-(-ns * 72 // 1000) for ns in (board.steplen_ns, board.stepspace_ns)]
        assert sum(counts) == 4800
        assert 72_000_000 / sum(counts) == board.step_rate_max_hz == board.driver_rate_max_hz == 15_000
        assert board.steplen_ns == 1.1 * 30_000  # 10 % above the chip's minimum at 330 pF
        assert (board.osc_pf, board.bitrate) == (330, 1_000_000)
        assert (board.dirsetup_ns, board.dirhold_ns) == (15_000, 15_000)

    def test_has_its_home_within_limits(self, robot: Robot) -> None:
        home = np.array(robot.home)
        assert np.all(home >= [joint.lower for joint in robot.joints])
        assert np.all(home <= [joint.upper for joint in robot.joints])

    def test_the_inverse_of_the_home_pose_is_home(self, robot: Robot) -> None:
        """One branch of the home pose is the home position; without a tool there is no pose."""
        kinematics, home = make_kinematics(robot), np.array(robot.home)
        if not kinematics.task.width:
            assert kinematics.branches == ()
            return
        branches = kinematics.inverse(kinematics.forward(home[np.newaxis]), home)
        assert any(branch.reachable[0] and np.allclose(branch.joints[0], home, atol=1e-4) for branch in branches)

    def test_each_number_is_marked_with_its_origin(self, robot: Robot) -> None:
        """[S]tated, [D]erived or [A]ssumed; a place or a box has one mark for all its numbers."""
        text = brought_text(robot.name)
        section = ""
        for line in text.splitlines():
            section = line if line.startswith("[") else section
            if re.match(r"\S+ = [-\d{\[]", line):
                assert re.search(r"# \[[SDA]\]", section + line), line


class TestTransmissions:
    @pytest.mark.parametrize("microsteps", [1, 2, 4, 5, 8, 10, 16, 20, 25, 32, 40, 50, 64, 100, 125, 128, 256])
    def test_wire_units_do_not_depend_on_microsteps(self, microsteps: int) -> None:
        transmission = Transmission(200, microsteps, 360.0, 5.0)
        assert transmission.wire_units_per_unit == 200 * 5 * 16384 / 360
        assert transmission.steps_per_unit == 200 * microsteps * 5 / 360
        assert transmission.travel_per_rev == 72.0

    @pytest.mark.parametrize("microsteps", [0, 3, -1, 300])
    def test_no_driver_has_other_microsteps(self, microsteps: int) -> None:
        with refusing(InputError):
            Transmission(200, microsteps, 10.0)

    @pytest.mark.parametrize(("microsteps", "nearest"), [(4, "are 2 and 8"), (32, "is 16")])
    def test_a_joint_has_the_microsteps_of_its_driver(self, microsteps: int, nearest: str) -> None:
        told = complaint(changed("microsteps = 16", f"microsteps = {microsteps}"))
        assert told == (
            f"mine.toml: joints.th1.microsteps: {microsteps} is not one of chip-330pf's 1, 2, 8, 16:"
            f" the nearest {nearest}"
        )

    def test_the_wire_ends_at_131_072_full_steps(self) -> None:
        """655.36 turns of 200 full steps, less one unit: 6553.6 mm with a lead of 10 mm."""
        screw = Transmission(200, 8, 10.0)
        assert Joint("z", Unit.MM, -6553.5, 6553.5, 80, 300, screw).upper == 6553.5
        with refusing(InputError):
            Joint("z", Unit.MM, 0, 6553.7, 80, 300, screw)
        with refusing(InputError):
            Joint("z", Unit.MM, -6553.7, 0, 80, 300, screw)


class TestMistakesInAFile:
    @pytest.mark.parametrize(
        ("old", "new"),
        [
            pytest.param("microsteps = 16", "microsteps = 4", id="microsteps"),
            pytest.param("ratio = 5.0", "", id="missing"),
            pytest.param("ratio = 5.0", "ratio = 0", id="zero"),
            pytest.param("ratio = 5.0", "ratio = nan", id="nan"),
            pytest.param("ratio = 5.0", "ratio = 1e10", id="huge"),
            pytest.param("ratio = 5.0", f"ratio = {'9' * 400}", id="huge integer"),
            pytest.param("_rev = 200", f"_rev = {'9' * 400}", id="huge count"),
            pytest.param("ratio = 5.0", f"ratio = {'9' * 5000}", id="integer bomb"),
            pytest.param("ratio = 5.0", f"ratio = {'[' * 9999}", id="depth bomb"),
            pytest.param("ratio = 5.0", "ratio = true", id="boolean"),
            pytest.param("ratio = 5.0", 'ratio = "5"', id="text"),
            pytest.param(
                "ratio = 5.0",
                "ratoi = 5.0",
                id="mistyped",
            ),
            pytest.param(
                "microsteps = 16",
                "ratoi = 5.0",
                id="unknown, and another is missing",
            ),
            pytest.param(
                "ratio = 5.0",
                "ratio = 5.0\ntravel_per_turn = 360.0",
                id="of another unit",
            ),
            pytest.param(
                "ratio = 5.0",
                "ratio = 5.0\nmicrostep = 8",
                id="unknown",
            ),
            pytest.param("microsteps = 8", "microsteps = 8.0", id="float"),
            pytest.param("travel_per_turn = 10.0", "travel_per_turn = -1", id="lead"),
            pytest.param('unit = "deg"', 'unit = "rad"', id="unit"),
            pytest.param("upper = 2000.0", "upper = 0.0", id="limits"),
            pytest.param("speed_max = 80.0", "speed_max = 0", id="speed"),
            pytest.param(
                "acceleration_max = 720.0",
                "acceleration_max = -1",
                id="acceleration",
            ),
            pytest.param("osc_pf = 330", "osc_pf = 0", id="board"),
            pytest.param(
                "osc_pf = 330",
                "osc_pf = 63",
                id="fast oscillator",
            ),
            pytest.param("osc_pf = 330", "", id="no driver"),
            pytest.param(
                "osc_pf = 330",
                'driver_profile = "3a-modul"',
                id="driver profile",
            ),
            pytest.param(
                "osc_pf = 330",
                'driver_profile = "3a-module"\nosc_pf = 330',
                id="two drivers",
            ),
            pytest.param("osc_pf = 330", "driver_profile = 3", id="no name"),
            pytest.param("osc_pf = 330", "osc_pf = 330\ncurrent_a = 0", id="0 A"),
            pytest.param(
                "osc_pf = 330",
                "osc_pf = 330\ncurrent_a = 3.1",
                id="3.1 A",
            ),
            pytest.param(
                "microsteps = 8",
                "microsteps = 8\ncurrent_a = 3.1",
                id="3.1 A at a joint",
            ),
            pytest.param(
                "osc_pf = 330",
                'driver_profile = "3a-module"\nidle_percent = 30',
                id="idle current",
            ),
            pytest.param(
                "osc_pf = 330",
                'driver_profile = "3a-module"\nfast_decay_percent = 75',
                id="decay",
            ),
            pytest.param(
                "osc_pf = 330",
                "osc_pf = 330\nidle_percent = 20",
                id="no switch for idle current",
            ),
            pytest.param(
                "osc_pf = 330",
                'driver_profile = "slow-blue-board"\nfast_decay_percent = 0',
                id="no switch for decay",
            ),
            pytest.param(
                "osc_pf = 330",
                'osc_pf = 330\nactive_edge = "both"',
                id="edge",
            ),
            pytest.param(
                "osc_pf = 330",
                'osc_pf = 330\ndriver_profil = "3a-module"',
                id="mistyped driver profile",
            ),
            pytest.param(
                "[board]",
                "[board]\nbitrate = 800_000",
                id="bit rate",
            ),
            pytest.param("33_000", "3_999", id="steplen"),
            pytest.param("15_000", "1_000_001", id="dirsetup"),
            pytest.param("[board]", "[board]\nbitrate = 1e6", id="bitrate"),
            pytest.param(
                "steplen_ns = 33_000",
                "steplen_ns = 33_002",
                id="pulses too long",
            ),
            pytest.param("L2_mm = 200.0", "L2_mm = []", id="dimension"),
            pytest.param("L2_mm = 200.0", "", id="missing dimension"),
            pytest.param(
                'kind = "warehouse-scara"',
                'kind = "warehouse"',
                id="kind",
            ),
            pytest.param('name = "warehouse-scara"', "name = 1", id="name"),
            pytest.param(
                "th2 = 60.0",
                "th2 = 151",
                id="home",
            ),
            pytest.param("th2 = 60.0", "", id="missing home"),
            pytest.param("th2 = 60.0", "th2 = 60.0\nth4 = 0", id="home of nobody"),
            pytest.param("[575.0, 1175.0]", "[575.0, 575.0]", id="flat box"),
            pytest.param("[575.0, 1175.0]", "[575.0]", id="one end"),
            pytest.param("[575.0, 1175.0]", '[575.0, "x"]', id="end of a box"),
            pytest.param("[575.0, 1175.0]", "575.0", id="no ends"),
            pytest.param(
                'held_by = "lock"',
                'held_by = "lok"',
                id="held by nothing",
            ),
            pytest.param("[board]", "[bord]", id="section"),
            pytest.param(
                'name = "warehouse-scara"',
                f'name = "{"x" * 65}"',
                id="long name",
            ),
            pytest.param(
                'name = "warehouse-scara"',
                f'name = "{"x" * 100_000}"',
                id="very long name",
            ),
            pytest.param(
                'name = "warehouse-scara"',
                r'name = "a\u001b[31m"',
                id="escape sequence",
            ),
            pytest.param(
                "[joints.th3]",
                '[joints."\\u0000"]',
                id="name of a joint",
            ),
            pytest.param(
                "[places.A1]",
                f"[places.{'A' * 65}]",
                id="name of a place",
            ),
            pytest.param(
                "magnet = {",
                f"{'m' * 65} = {{",
                id="name of an output",
            ),
            pytest.param(
                "[joints.th3]",
                "[joints.th4]",
                id="other joint",
            ),
            pytest.param("[kinematics]", "[kinematics", id="no TOML"),
            pytest.param('name = "warehouse-scara"', 'colour = 1\nname = "x"', id="top"),
        ],
    )
    def test_an_error_names_its_key(self, old: str, new: str) -> None:
        complaint(changed(old, new))

    @pytest.mark.parametrize(
        ("old", "new"),
        [
            pytest.param(
                'joint = "th3", out = 1',
                'joint = "th4", out = 1',
                id="joint",
            ),
            pytest.param("out = 1", "out = 0", id="out 0"),
            pytest.param("out = 1", "out = 3", id="out 3"),
            pytest.param("out = 1", "out = true", id="boolean"),
            pytest.param("out = 1", "out = 1.0", id="float"),
            pytest.param(", out = 1", "", id="no out"),
            pytest.param('joint = "th3", ', "", id="no joint"),
            pytest.param(
                "out = 1",
                "out = 1, pin = 3",
                id="key",
            ),
            pytest.param("out = 2", "out = 1", id="taken"),
            pytest.param('lock = { joint = "th3", out = 2 }', "lock = 2", id="no table"),
            pytest.param(
                "[outputs]",
                '[inputs.part]\njoint = "th3"\ninput = 3\n[outputs]',
                id="input 3",
            ),
            pytest.param(
                'box_present = { joint = "th3", input = 2 }',
                'box_present = { joint = "th3", input = 1 }',
                id="input taken",
            ),
            pytest.param(
                'drawer_end = { joint = "th2"',
                'drawer_end = { joint = "th4"',
                id="input's joint",
            ),
            pytest.param("sx = 400.0", "sx = 2000.1", id="outside"),
            pytest.param("sz = 50.0", "sz = -0.1", id="below"),
            pytest.param(
                "sx = 400.0",
                "sy = 1",
                id="no such joint",
            ),
            pytest.param("sx = 400.0", 'sx = "left"', id="text"),
            pytest.param("sx = 400.0", "sx = inf", id="inf"),
            pytest.param("[places.A1]", "[places.A0]\n[places.A1]", id="empty place"),
            pytest.param("[places.hand-over]", "[places]\nA0 = 3\n[places.hand-over]", id="number"),
        ],
    )
    def test_of_outputs_and_places(self, old: str, new: str) -> None:
        complaint(changed(old, new))

    def test_outputs_and_places_must_be_tables(self) -> None:
        text = TEXT[: TEXT.index("[outputs]")]
        for key in ("outputs", "places"):
            assert complaint(f"{key} = 3\n{text}") == f"mine.toml: {key}: 3 is not a table"

    def test_a_section_must_be_a_table(self) -> None:
        head = TEXT[: TEXT.index("[kinematics]")]
        assert complaint(f"{head}kinematics = 3\n").startswith("mine.toml: kinematics: 3 is not a table")
        robot = TEXT[: TEXT.index("[joints.sx]")]
        assert complaint(f"{robot}[joints]\nsx = 1\n").startswith("mine.toml: joints.sx: 1 is not a table")
        assert complaint(f"{robot}[joints]\n[home]\n") == (
            "mine.toml: joints.sx: is missing: the joints of this 'warehouse-scara' are sx sz L1 th1 th2 th3"
        )

    def test_a_speed_that_the_driver_cannot_follow(self) -> None:
        """75 mm/s at a lead of 8 mm and 1/8 step is exactly 15 kHz."""
        lead = changed("travel_per_turn = 10.0", "travel_per_turn = 8.0")
        fast = parse_robot(lead.replace("speed_max = 80.0", "speed_max = 75.0"), "mine.toml")
        assert fast.joint("sz").step_rate_max_hz == 15_000
        assert complaint(lead) == (
            "mine.toml: joints.sz.speed_max: 80 mm/s takes 16.0 kHz of steps, more than the driver's 15.0 kHz;"
            " speed_max = 75 or microsteps = 2 would do"
        )


class TestDrivers:
    def test_are_bare_chips_by_their_capacitor_unless_said_otherwise(self) -> None:
        board = ROBOT.board
        assert (board.osc_pf, board.driver_profile, board.current_a, board.active_edge) == (330, None, None, None)

    @pytest.mark.parametrize("name", ["chip-100pf", "chip-330pf", "3a-module", "slow-blue-board"])
    def test_may_be_named(self, name: str) -> None:
        text = changed("osc_pf = 330", f'driver_profile = "{name}"\ncurrent_a = 3\nactive_edge = "falling"')
        board = parse_robot(text, "mine.toml").board
        assert (board.osc_pf, board.driver_profile) == (None, name)
        assert (board.current_a, board.active_edge) == (3, ActiveEdge.FALLING)

    def test_named_ones_count_the_boards_pulses(self) -> None:
        with refusing(InputError):
            parse_robot(changed("osc_pf = 330", 'driver_profile = "chip-1000pf"'), "mine.toml")

    @pytest.mark.parametrize("idle_percent", [20, 50])
    @pytest.mark.parametrize("fast_decay_percent", [0, 25, 50, 100])
    def test_may_have_switches(self, idle_percent: int, fast_decay_percent: int) -> None:
        """Every position of the module's switches: it sets the levels at the chip and the current at standstill."""
        settings = f"idle_percent = {idle_percent}\nfast_decay_percent = {fast_decay_percent}"
        text = changed("osc_pf = 330", f'driver_profile = "3a-module"\ncurrent_a = 2\n{settings}')
        robot = parse_robot(text, "mine.toml")
        (config,) = board_configs(robot)
        driver = Driver(config.modules[0])
        driver.feed(pins(changes=POWER_UP, until=600 * 72_000))
        currents = np.abs(driver.chip.outputs.currents_a(np.array([499, 501]) * 72_000)).max(axis=1)
        assert currents.tolist() == pytest.approx([0.5 * (1 / 0.33 + 1 / 1.2), currents[0] * idle_percent / 100])
        switches = config.modules[0].switches
        assert switches is not None
        levels = switches.running["DCY2"], switches.running["DCY1"]
        assert levels == {0: (0, 0), 25: (0, 1), 50: (1, 0), 100: (1, 1)}[fast_decay_percent]

    def test_the_smallest_capacitor_is_a_choice(self) -> None:
        assert parse_robot(changed("osc_pf = 330", "osc_pf = 64"), "mine.toml").board.osc_pf == 64


LINES = TEXT.splitlines()
VALUES = st.one_of(
    st.sampled_from(["[]", "{}", "inf", "nan", "true", "2020-01-01", "12:00:00", "5e-324", "-0.0", "9" * 400, "0x10"]),
    st.sampled_from(['"mm"', '"deg"', '"th1"', '"lab-scara"', '""', "''", "'\u2028'", '"""\n"""', "[[1]", ""]),
    st.integers().map(str),
    st.floats(allow_nan=False, allow_infinity=False).map(repr),
    st.text(max_size=5),
)


@pytest.mark.slow
@given(place=st.sampled_from([i for i, line in enumerate(LINES) if re.match(r"\w+ = ", line)]), value=VALUES)
def test_any_value_at_any_key_gives_a_robot_or_an_error(place: int, value: str) -> None:
    key = LINES[place].partition(" = ")[0]
    text = "\n".join([*LINES[:place], f"{key} = {value}", *LINES[place + 1 :]])
    try:
        robot = parse_robot(text, "mine.toml")
    except InputError as error:
        message = str(error)
        assert message.startswith("mine.toml: ")
        assert len(message.splitlines()) == 1
    else:
        assert np.isfinite(robot.wire_units_per_unit).all()


@given(st.binary().map(lambda content: content.decode("utf-8", "replace")) | st.text())
def test_any_text_gives_an_error(text: str) -> None:
    assert complaint(text).startswith("mine.toml: ")


class TestOutputsAndPlaces:
    def test_of_the_robot_that_comes_along(self) -> None:
        assert ROBOT.outputs == {"magnet": Output("th3", 1), "lock": Output("th3", 2)}
        assert set(ROBOT.places) == {"hand-over", "pick-up", "output", "A1", "A2", "B1", "B2"}
        assert ROBOT.places["B2"] == {"sx": 800, "sz": 300}
        assert set(ROBOT.places["hand-over"]) == set(ROBOT.joint_names)

    def test_may_be_missing_or_empty(self) -> None:
        text = TEXT[: TEXT.index("[outputs]")].replace('payload_held_by = "magnet"', "")
        for tables in ("", "[outputs]\n[places]\n"):
            robot = parse_robot(text + tables, "mine.toml")
            assert (robot.outputs, robot.places) == ({}, {})

    def test_a_place_may_be_at_the_limits(self) -> None:
        robot = parse_robot(changed("sx = 400.0\nsz = 300.0", "sx = 2000\nL1 = 50.0\nsz = 300.0"), "mine.toml")
        assert robot.places["B1"] == {"sx": 2000, "L1": 50, "sz": 300}

    def test_both_outputs_of_several_axes(self) -> None:
        more = changed("lock = {", 'lamp = { joint = "sx", out = 1 }\nlock = {')
        assert parse_robot(more, "mine.toml").outputs["lamp"] == Output("sx", 1)


class TestLoading:
    def test_an_unknown_name_offers_the_nearest(self) -> None:
        with refusing(InputError):
            load_robot("warehouse-skara")

    def test_a_name_near_none_offers_all(self) -> None:
        with refusing(InputError):
            load_robot("zzz")

    def test_a_users_own_file(self, tmp_path: Path) -> None:
        file = tmp_path / "mine.toml"
        file.write_text(changed('name = "warehouse-scara"', 'name = "mine"'), encoding="utf-8")
        assert load_robot(str(file)).name == "mine"

    def test_a_file_of_any_name(self, tmp_path: Path) -> None:
        file = tmp_path / "mine.conf"
        file.write_text(TEXT, encoding="utf-8")
        assert load_robot_file(str(file)) == ROBOT

    def test_a_file_that_cannot_be_read(self, tmp_path: Path) -> None:
        with refusing(InputError):
            load_robot(str(tmp_path / "none.toml"))
        (tmp_path / "latin.toml").write_bytes(b"# \xe4\n")
        with refusing(InputError):
            load_robot(str(tmp_path / "latin.toml"))
        with refusing(InputError):
            load_robot_file(str(tmp_path))
        with refusing(InputError):
            load_robot_file("a\0b")
