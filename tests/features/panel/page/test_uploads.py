"""Several uploaded files: which is to be run, and what a program may refer to."""

import numpy as np
import pytest

pytest.importorskip("nicegui", reason="the extra `panel` is not installed")

from steptwin.features.panel.page.motions import UploadedMotion, plan_upload
from steptwin.features.panel.page.uploads import companions, to_run
from steptwin.host.common.errors import InputError
from steptwin.host.robots import load_robot
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.kinematics.base import tool_places_mm

ROBOT = load_robot("teaching-scara")
PARK = b'robot = "teaching-scara"\n[positions]\npark = { th1 = 2.0, th2 = 10.0, d3 = 0.0, th4 = 0.0 }\n'


def program(robot: str = "teaching-scara.toml") -> bytes:
    return f'robot = "{robot}"\npositions_file = "saved/park.toml"\n[[step]]\ngo = "park"\nduration_s = 2\n'.encode()


def refusal(name: str, content: bytes, **beside: bytes) -> str:
    with pytest.raises(InputError) as refused:
        plan_upload(
            UploadedMotion(ROBOT, name, content, None, beside={f"{stem}.toml": beside[stem] for stem in beside})
        )
    return str(refused.value)


def test_a_program_with_its_files() -> None:
    """The robot's file is the machine's own, as if it lay beside the program."""
    for robot in ("teaching-scara.toml", "../../teaching-scara.toml"):
        plan, _ = plan_upload(UploadedMotion(ROBOT, "p.toml", program(robot), None, beside={"park.toml": PARK}))
        assert plan.motion.positions(np.array([2.0]))[0].tolist() == pytest.approx([2.0, 10.0, 0.0, 0.0])


def test_what_is_missing_is_named() -> None:
    assert (
        refusal("p.toml", program())
        == "p.toml: positions_file: saved/park.toml: is not uploaded: choose both files at once"
    )
    told = refusal("p.toml", program("arm.toml"), park=PARK)
    assert told.startswith("p.toml: robot: arm.toml: is not uploaded, and the machine is teaching-scara: choose both")
    told = refusal("p.toml", program("arm.toml"), park=PARK, arm=load_robot("lab-scara").toml.encode())
    assert "the program is for lab-scara in arm.toml, not for teaching-scara" in told
    step = b'[[step]]\ngcode = "part.nc"\n'
    assert refusal("p.toml", step) == "p.toml: gcode: part.nc: is not uploaded: choose both files at once"


@pytest.mark.parametrize("place", ["/etc/passwd", "../../../../../../../../etc/passwd"])
def test_nothing_of_this_computer_is_read(place: str) -> None:
    told = refusal("p.toml", f'[[step]]\ngcode = "{place}"\n'.encode())
    assert told.startswith(f"p.toml: gcode: {place}: is ")
    assert "root" not in told


@pytest.mark.parametrize("folder", ["a/" * 3000, "a\\u0000/", "park.toml/"])
def test_a_name_that_no_file_has(folder: str) -> None:
    own = f'positions_file = "park.toml"\n[[step]]\ngcode = "{folder}park.toml"\n'.encode()
    assert refusal("p.toml", own, park=PARK).endswith("is no name of a file")


@pytest.mark.slow
def test_gcode_alone_and_in_a_program() -> None:
    x_mm, y_mm = 100.0, 100.0
    content = f"G21 G90\nG0 X{x_mm} Y{y_mm} Z-40\nG1 Y{y_mm + 40} F1200\n".encode()
    own = b'[[step]]\ngcode = "n/part.nc"\n'
    plans = [
        plan_upload(UploadedMotion(ROBOT, name, content, None))[0] for name in ("part.nc", 'p"\n.ngc', "part.GCODE")
    ]
    plans.append(plan_upload(UploadedMotion(ROBOT, "p.toml", own, None, beside={"part.nc": content}))[0])
    for plan in plans:
        end = plan.motion.positions(np.array([plan.motion.duration_s]))
        assert tool_places_mm(make_kinematics(ROBOT), end)[0, :2].tolist() == pytest.approx([x_mm, y_mm + 40])


def test_the_file_that_is_to_be_run() -> None:
    own = program()
    assert to_run({}) is None
    assert to_run({"a.csv": b"", "b.csv": b""}) == "b.csv"
    assert to_run({"p.toml": own, "park.toml": PARK}) == to_run({"park.toml": PARK, "p.toml": own}) == "p.toml"
    assert companions({"a.csv": b"", "park.toml": PARK, "p.toml": own}) == ["park.toml"]
    assert to_run({"part.nc": b"", "p.toml": b'[[step]]\ngcode = "part.nc"\n'}) == "p.toml"
    assert to_run({"p.toml": own, "other.nc": b""}) == "other.nc"
    assert to_run({"broken.toml": b"["}) == "broken.toml"
