"""The two sliders' mechanism: its circles, its four working modes, its two assembly modes, and its edges."""

import numpy as np
import pytest

from steptwin.features.papers.hybrid_arm import AssemblyMode, SliderPair, WorkingMode
from steptwin.host.common.arrays import FloatArray

PAIR = SliderPair(150.0, 350.0)


def at(*values: float) -> FloatArray:
    return np.array(values)


def test_a_hand_case() -> None:
    """Links of 350 mm rise by 316.23 mm across 150 mm. With c right above a screw they rise by 350 mm and 180.28 mm."""
    rise_mm = np.sqrt(350.0**2 - 150.0**2)
    assert PAIR.inverse(at(0.0), at(0.0), WorkingMode.BOTH_BELOW) == pytest.approx(
        at(-rise_mm, -rise_mm)[:, np.newaxis]
    )
    left_mm, right_mm = PAIR.inverse(at(-150.0), at(10.0), WorkingMode.LEFT_ABOVE)
    assert left_mm == pytest.approx([360.0])
    assert right_mm == pytest.approx([10.0 - np.sqrt(350.0**2 - 300.0**2)])


@pytest.mark.parametrize("assembly", AssemblyMode)
def test_both_links_keep_their_length(assembly: AssemblyMode) -> None:
    left_mm, right_mm = np.random.default_rng(1).uniform(-250.0, 250.0, (2, 10_000))
    z2_mm, z3_mm = PAIR.forward(left_mm, right_mm, assembly)
    assert np.hypot(z2_mm + 150.0, z3_mm - left_mm) == pytest.approx(np.full(10_000, 350.0))
    assert np.hypot(z2_mm - 150.0, z3_mm - right_mm) == pytest.approx(np.full(10_000, 350.0))
    line_mm = (left_mm + right_mm) / 2 + (right_mm - left_mm) * z2_mm / 300.0
    assert np.all((z3_mm - line_mm) * assembly.value > 0)


@pytest.mark.parametrize("mode", WorkingMode)
def test_sliders_are_on_the_sides_that_the_mode_says(mode: WorkingMode) -> None:
    z2_mm = np.random.default_rng(2).uniform(-199.0, 199.0, 1000)
    left_mm, right_mm = PAIR.inverse(z2_mm, np.zeros(1000), mode)
    assert np.all(-left_mm * mode.signs[0] > 0)
    assert np.all(-right_mm * mode.signs[1] > 0)


def test_modes_by_their_names() -> None:
    assert [mode.value for mode in WorkingMode] == ["(+,+)", "(+,-)", "(-,+)", "(-,-)"]
    assert [mode.signs for mode in WorkingMode] == [(1, 1), (1, -1), (-1, 1), (-1, -1)]


@pytest.mark.parametrize(
    ("mode", "assemblies"),
    [
        (WorkingMode.BOTH_BELOW, [1, 1, 1]),
        (WorkingMode.RIGHT_ABOVE, [1, 0, -1]),
        (WorkingMode.LEFT_ABOVE, [-1, 0, 1]),
        (WorkingMode.BOTH_ABOVE, [-1, -1, -1]),
    ],
)
def test_mixed_modes_change_their_assembly_in_the_middle(mode: WorkingMode, assemblies: list[int]) -> None:
    assert PAIR.assembly_of(at(-10.0, 0.0, 10.0), mode).tolist() == assemblies


def test_the_largest_distance_of_the_sliders() -> None:
    """2 sqrt(L^2 - h^2); with the links in line c is half way between the sliders."""
    apart_mm = 632.455532
    for assembly in AssemblyMode:
        z2_mm, z3_mm = PAIR.forward(at(apart_mm / 2), at(-apart_mm / 2), assembly)
        assert [*z2_mm, *z3_mm] == pytest.approx([0.0, 0.0], abs=0.05)  # k is the root of a rounding error
        assert np.isnan(PAIR.forward(at(apart_mm / 2 + 1e-6), at(-apart_mm / 2), assembly)).all()


def test_the_largest_sideways_travel_of_c() -> None:
    assert PAIR.reach_mm == 200.0
    assert np.isfinite(PAIR.inverse(at(-200.0, 200.0), at(0.0, 0.0), WorkingMode.BOTH_BELOW)).all()
    assert np.isnan(PAIR.inverse(at(-200.0 - 1e-9), at(0.0), WorkingMode.BOTH_BELOW)).any()


def test_a_level_link_has_no_slider_velocity() -> None:
    with np.errstate(all="raise"):  # a singular pose gives no numpy warning
        velocities = PAIR.slider_velocities(at(0.0), at(-300.0), at(200.0), at(0.0), at(1.0), at(0.0))
    assert np.isfinite(velocities).tolist() == [[False], [True]]


@pytest.mark.parametrize("assembly", AssemblyMode)
def test_the_sines_by_plain_vectors(assembly: AssemblyMode) -> None:
    left_mm, right_mm = np.random.default_rng(3).uniform(-250.0, 250.0, (2, 1000))
    z2_mm, z3_mm = PAIR.forward(left_mm, right_mm, assembly)
    links = np.array([[z2_mm + 150.0, z3_mm - left_mm], [z2_mm - 150.0, z3_mm - right_mm]])
    slopes = np.arctan2(links[:, 1], links[:, 0])
    left, right, between = PAIR.sines(left_mm, right_mm, z2_mm, z3_mm)
    assert np.array([left, right]) == pytest.approx(np.abs(np.sin(slopes)))
    assert between == pytest.approx(np.abs(np.sin(slopes[1] - slopes[0])))
