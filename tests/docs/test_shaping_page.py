"""What is left of the oscillation by the model of motors: the figures of docs/motions.md."""

import pytest

from docs.generate.motion_pictures import Swing


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "lasts_s", "swings_mm", "behind_deg"),
    [("unshaped", 4.034, 6.13, 64), ("zv", 4.165, 0.00, 31), ("mzv", 4.230, 0.05, 27), ("ei", 4.295, 0.00, 20)],
)
def test_a_shaped_swing_leaves_no_oscillation(kind: str, lasts_s: float, swings_mm: float, behind_deg: int) -> None:
    swing = Swing.shaped(kind)
    assert swing.lasts_s == pytest.approx(lasts_s, abs=1e-9)
    assert swing.swings_mm == pytest.approx(swings_mm, abs=0.01)
    assert swing.behind_deg == pytest.approx(behind_deg, abs=0.6)
