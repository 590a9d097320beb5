"""Files of a calibration: measurements, and the robot file with the errors found."""

from pathlib import Path

import pytest

from steptwin.features.calibration.identification import corrected_text
from steptwin.features.calibration.measurements import (
    MEASUREMENTS_MAX,
    measurements_text,
    read_measurements,
    simulate_measurements,
)
from steptwin.host.robots import load_robot, parse_robot
from steptwin.host.robots.link_errors import LinkErrors
from steptwin.host.robots.new_file import robot_text, with_settings
from tests.host.complaints import complaint_of

ROBOT = load_robot("calibration-scara")
HEAD = "th1,th2,d3,th4,x,y,z\n"
LINE = "1,2,3,4,500,20,297\n"

FOUND = {"link1": LinkErrors(0.4123456789, 0.0, -0.5, 0.0), "link2": LinkErrors(), "link3": LinkErrors(theta_deg=-1e-6)}
ROUNDED = {"link1": LinkErrors(0.4123457, 0.0, -0.5, 0.0), "link3": LinkErrors(theta_deg=-1e-6)}


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "measurements.csv"


class TestMeasurements:
    def test_they_come_back_from_their_file(self, file: Path) -> None:
        measured = simulate_measurements(ROBOT, 30, 0.02, 1)
        file.write_text(measurements_text(ROBOT, measured), encoding="utf-8")
        read = read_measurements(str(file), ROBOT)
        assert read.joints.tolist() == pytest.approx(measured.joints, abs=1e-12)
        assert read.positions_mm == pytest.approx(measured.positions_mm, abs=0.5000001e-6)
        assert read.lines == tuple(range(2, 32))

    def test_columns_in_any_order_comments_and_empty_lines(self, file: Path) -> None:
        file.write_text('# by a tracker\nz, x,y,th4,d3,th2,"th1"\n\n297,500,20,4,3,2,1\n', encoding="utf-8")
        read = read_measurements(str(file), ROBOT)
        assert (read.joints.tolist(), read.positions_mm.tolist(), read.lines) == (
            [[1, 2, 3, 4]],
            [[500, 20, 297]],
            (4,),
        )

    @pytest.mark.parametrize(
        ("text", "words"),
        [
            ("", "is empty: a header th1,th2,d3,th4,x,y,z was expected"),
            ("th1,th2,d3,x,y,z\n", "line 1: column 'th4' is missing: the header is th1,th2,d3,th4,x,y,z, in any order"),
            (f"{HEAD[:-1]},phi\n", "line 1: column 'phi' is unknown: there are th1, th2, d3, th4, x, y, z"),
            (HEAD.replace("th2", "th1"), "line 1: column 'th1' appears 2 times"),
            (f"{HEAD}{LINE}1,2,3,4,5e2,2O,297\n", "line 3, y: '2O' is not a number"),
            (f"{HEAD}1,2,3,4,nan,20,297\n", "line 2, x: 'nan' is not a finite number up to 1e+09"),
            (f"{HEAD}1,2,3,4,500,20,\n", "line 2, z: '' is not a number"),
            (f"{HEAD}1,2,3,4,500,20\n", "line 2: 6 fields, the header has 7"),
            (
                f"{HEAD}{LINE}1,-145.5,3,4,5,6,7\n",
                "line 3, th2: -145.5 deg is outside -145..145 deg; the nearest is -145",
            ),
            (f'{HEAD}1,2,"3\n,4,5,6,7\n', "line 2: is not CSV"),
        ],
    )
    def test_what_is_wrong_is_told_with_line_column_and_value(self, file: Path, text: str, words: str) -> None:
        file.write_text(text, encoding="utf-8")
        complaint = complaint_of(lambda: read_measurements(str(file), ROBOT))
        assert complaint.startswith(f"{file}: {words}")

    def test_joints_at_their_limits_are_right(self, file: Path) -> None:
        file.write_text(f"{HEAD}130,-145,200,360,500,20,297\n", encoding="utf-8")
        assert read_measurements(str(file), ROBOT).joints.tolist() == [[130, -145, 200, 360]]

    @pytest.mark.slow
    def test_as_many_as_there_may_be(self, file: Path) -> None:
        file.write_text(HEAD + MEASUREMENTS_MAX * LINE, encoding="utf-8")
        assert read_measurements(str(file), ROBOT).repeats == MEASUREMENTS_MAX - 1
        file.write_text(HEAD + (MEASUREMENTS_MAX + 1) * LINE, encoding="utf-8")
        complaint_of(lambda: read_measurements(str(file), ROBOT))

    def test_a_byte_order_mark_is_left_out(self, file: Path) -> None:
        """As Excel writes it; `run` takes it, too."""
        file.write_text(HEAD + LINE, encoding="utf-8-sig")
        assert file.read_bytes().startswith(b"\xef\xbb\xbf")
        assert len(read_measurements(str(file), ROBOT)) == 1

    def test_a_repeated_pose_counts_once_where_it_was_measured_on_average(self, file: Path) -> None:
        """Joints of three decimals are the same pose; a thousandth of a degree more is another."""
        measured = ("1,2,3,4,500,20,297", "1.001,2,3,4,500,20,297", "1.0004,2,3,4,502,20,297", "1,2,3,4,501,23,297")
        file.write_text(HEAD + "".join(f"{line}\n" for line in measured), encoding="utf-8")
        read = read_measurements(str(file), ROBOT)
        assert read.positions_mm.tolist() == [[501, 21, 297], [500, 20, 297]]
        assert read.joints[:, 0].tolist() == pytest.approx([1.0004 / 3 + 2 / 3, 1.001])
        assert (read.lines, read.repeats, len(read)) == ((2, 3), 2, 2)

    def test_no_file(self, file: Path) -> None:
        complaint_of(lambda: read_measurements(str(file), ROBOT))

    def test_without_a_line_there_are_none(self, file: Path) -> None:
        file.write_text(HEAD, encoding="utf-8")
        read = read_measurements(str(file), ROBOT)
        assert (read.joints.shape, read.positions_mm.shape, len(read)) == ((0, 4), (0, 3), 0)


class TestCorrectedFile:
    def test_it_is_the_robot_with_the_errors(self) -> None:
        text = corrected_text(ROBOT, FOUND, "found in a test")
        assert text.startswith(ROBOT.toml)
        assert parse_robot(text, "corrected.toml").dh_errors == ROUNDED
        tables = text.removeprefix(ROBOT.toml).strip().splitlines()
        assert tables == [
            "[dh_errors.link1] # found in a test",
            "a_mm = 0.4123457",
            "d_mm = -0.5000000",
            "",
            "[dh_errors.link3] # found in a test",
            "theta_deg = -0.0000010",
        ]

    @pytest.mark.parametrize("where", ["last", "first", "one table"])
    def test_errors_in_the_file_are_replaced(self, where: str) -> None:
        old = "[dh_errors.link2] # of last year\na_mm = 1.0\n# more about it\n\n[dh_errors.link4]\nd_mm = 2.0\n\n"
        if where == "one table":
            old = "[dh_errors]\nlink2 = { a_mm = 1.0 }\nlink4.d_mm = 2.0\n\n"
        board = "[board]"
        text = f"{ROBOT.toml}\n{old}" if where == "last" else ROBOT.toml.replace(board, old + board, 1)
        robot = parse_robot(text, "old.toml")
        assert robot.dh_errors == {"link2": LinkErrors(a_mm=1.0), "link4": LinkErrors(d_mm=2.0)}
        assert corrected_text(robot, FOUND, "found") == corrected_text(ROBOT, FOUND, "found")
        assert corrected_text(robot, {}, "none").rstrip() == ROBOT.toml.rstrip()

    def test_a_form_that_cannot_be_replaced(self) -> None:
        robot = parse_robot(f"dh_errors.link1.a_mm = 1.0\n{ROBOT.toml}", "mine.toml")
        words = "dh_errors: stands in a line of its own; only tables such as [dh_errors.link1] can be replaced"
        assert complaint_of(lambda: corrected_text(robot, FOUND, "found")) == words


class TestErrorsInARobotFile:
    @pytest.mark.parametrize(
        ("table", "words"),
        [
            (
                "[dh_errors.link1]\na_mm = 50.1",
                "dh_errors.link1.a_mm: 50.1 mm is outside -50..50 mm; the nearest is 50 mm",
            ),
            ("[dh_errors.link4]\ntheta_deg = -10.1", "dh_errors.link4.theta_deg: -10.1 deg is outside -10..10 deg"),
            ("[dh_errors.link2]\nalpha_deg = nan", "dh_errors.link2.alpha_deg: nan is not a finite number"),
            ("[dh_errors.link2]\nd_mm = '1'", "dh_errors.link2.d_mm: '1' is not a number"),
            ("[dh_errors.link2]\nalpha = 1", "dh_errors.link2.alpha: key 'alpha' is unknown: did you mean alpha_deg?"),
            ("[dh_errors.link5]\na_mm = 1", "dh_errors: link 'link5' is unknown: did you mean link"),
            ("[dh_errors]\nlink1 = 3", "dh_errors.link1: 3 is not a table"),
        ],
    )
    def test_what_is_wrong(self, table: str, words: str) -> None:
        complaint = complaint_of(lambda: parse_robot(f"{ROBOT.toml}\n{table}\n", "mine.toml"))
        assert complaint.startswith(f"mine.toml: {words}")

    def test_the_largest_errors(self) -> None:
        table = "[dh_errors.link1]\na_mm = 50\nalpha_deg = -10\nd_mm = -50\ntheta_deg = 10\n"
        robot = parse_robot(f"{ROBOT.toml}\n{table}", "mine.toml")
        assert robot.dh_errors == {"link1": LinkErrors(50.0, -10.0, -50.0, 10.0)}

    def test_of_a_robot_that_is_no_chain(self) -> None:
        text = f"{load_robot('hybrid-arm').toml}\n[dh_errors.link1]\na_mm = 1.0\n"
        words = "mine.toml: dh_errors: a 'hybrid-arm' is not a chain of DH links: z2 and z3 are no joints"
        assert complaint_of(lambda: parse_robot(text, "mine.toml")) == words

    def test_the_dimensions_decide_on_the_links(self) -> None:
        """A SCARA has a row for its lift only with a lift; link names of another arm are refused."""
        text = _new_scara("none")
        assert parse_robot(f"{text}\n[dh_errors.link4]\na_mm = 1.0\n", "mine.toml").dh_errors
        with_lift = f"{_new_scara('first')}\n[dh_errors.link5]\na_mm = 1.0\n"
        assert parse_robot(with_lift, "mine.toml").dh_errors
        complaint_of(lambda: parse_robot(f"{text}\n[dh_errors.link5]\na_mm = 1.0\n", "mine.toml"))


def _new_scara(lift: str) -> str:
    return robot_text("arm", "scara", *with_settings("scara", {"lift": lift}))
