"""Short lines of G-code that become arcs: which do, how far the path is from them, and that it is no slower."""

from pathlib import Path

import numpy as np
import pytest

from steptwin.features.gcode.blocks import read_blocks
from steptwin.features.gcode.cut_runs import curved
from steptwin.features.gcode.modal import CutMove, actions
from tests.features.gcode.test_gcode_stops import compiled


def moves_of(text: str) -> list[CutMove]:
    start = (0.0, 0.0, 0.0, 0.0)
    return [each for each in actions(read_blocks(f"F600\n{text}").blocks, start, start) if isinstance(each, CutMove)]


def circle(parts: int, last_deg: float, r_mm: float = 10.0) -> str:
    """Return lines along a circle from its lowest place, counter-clockwise."""
    angle = np.deg2rad(np.linspace(0.0, last_deg, parts + 1)[1:])
    return "\n".join(f"G1 X{r_mm * np.sin(a):.6f} Y{r_mm - r_mm * np.cos(a):.6f}" for a in angle)


def test_lines_along_a_circle_become_one_arc_with_its_centre() -> None:
    (arc,) = curved(moves_of(f"G64 P0.1\n{circle(40, 180)}"))
    assert arc.arc is not None
    assert (arc.arc.x_mm, arc.arc.y_mm) == pytest.approx((0.0, 10.0), abs=1e-4)
    assert arc.arc.sweep_rad == pytest.approx(np.pi, abs=1e-5)
    assert arc.arc.growth == pytest.approx(0.0, abs=1e-9)
    assert arc.goal[:2] == pytest.approx((0.0, 20.0))


def test_an_arc_keeps_all_places_within_the_distance_and_a_smaller_one_needs_more_arcs() -> None:
    ellipse = "\n".join(f"G1 X{20 * np.sin(a):.5f} Y{8 - 8 * np.cos(a):.5f}" for a in np.linspace(0.0, np.pi, 121)[1:])
    counts = []
    for off_mm in (0.1, 0.01):
        moves = moves_of(f"G64 P{off_mm}\n{ellipse}")
        found = curved(moves)
        counts.append(len(found))
        arcs = [(np.array([each.arc.x_mm, each.arc.y_mm]), each) for each in found if each.arc]
        for centre, each in arcs:
            own = [move for move in moves if each.line <= move.line]
            last = next(i for i, move in enumerate(own) if move.goal == each.goal)
            radius = np.linalg.norm(np.array(each.start[:2]) - centre)
            away = [np.linalg.norm(np.array(move.goal[:2]) - centre) - radius for move in own[: last + 1]]
            assert np.abs(away).max() <= off_mm + 1e-9
    assert 2 < counts[0] < counts[1] < 60


@pytest.mark.parametrize(
    ("text", "count"),
    [
        (f"G64 P0.1\n{circle(3, 40)}", 3),
        (f"G64 P0.1 Q0\n{circle(40, 180)}", 40),
        (f"G61\n{circle(40, 180)}", 40),
        (f"G64 P0.1\n{circle(8, 280)}", 8),
        (f"G64 P0.1\n{circle(20, 90)}\nF500\nX15\nX20", 3),
    ],
    ids=["few", "no merging", "exact stop", "corners", "another feed"],
)
def test_what_stays_as_it_is(text: str, count: int) -> None:
    assert len(curved(moves_of(text))) == count


def test_a_helix_of_lines_and_an_output_between_them_stay() -> None:
    climbing = "\n".join(f"{line} Z{0.1 * i:.1f}" for i, line in enumerate(circle(20, 90).splitlines()))
    assert not any(each.arc for each in curved(moves_of(f"G64 P0.1\n{climbing}")))
    half = circle(20, 90).splitlines()
    switched = "\n".join([*half[:10], "M62 P0", *half[10:]])
    assert [len(each.changes) for each in curved(moves_of(f"G64 P0.1\n{switched}"))] == [0, 1]


@pytest.mark.slow
def test_a_wave_of_short_lines_is_faster_as_arcs_and_noise_is_not_followed(tmp_path: Path) -> None:
    x = np.linspace(0.0, 60.0, 301)[1:]
    wave = [f"G1 X{a:.4f} Y{6 * np.sin(a / 6):.4f}" for a in x]
    as_arcs = compiled(tmp_path, "\n".join(["F9000 G64 P0.05", *wave]))
    as_lines = compiled(tmp_path, "\n".join(["F9000 G64 P0.05 Q0.0000001", *wave]))
    assert as_arcs.motion.duration_s < 0.97 * as_lines.motion.duration_s
    rough = [f"G1 X{a:.4f} Y{b:.4f}" for a, b in zip(x, 0.003 * np.random.default_rng(1).normal(size=300), strict=True)]
    fine = compiled(tmp_path, "\n".join(["F9000 G64 P0.05 Q0.004", *rough])).motion.duration_s
    assert fine <= 1.05 * compiled(tmp_path, "\n".join(["F9000 G64 P0.05 Q0.0000001", *rough])).motion.duration_s
