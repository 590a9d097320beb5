"""What the service keeps of planned path and trace."""

import numpy as np

from steptwin.features.panel.service.history import Drawing


def pose(x_mm: float) -> dict[str, float]:
    return {"x_mm": x_mm, "y_mm": 1.0, "z_mm": 2.0, "attitude_deg": 90.0}


def test_a_trace_has_the_points_that_are_half_a_millimetre_apart_and_is_bounded() -> None:
    drawing = Drawing()
    for x_mm in (0.0, 0.49, 0.5, 0.99, 1.0):
        drawing.follow(pose(x_mm))
    drawing.follow(None)
    assert drawing.trace_mm.tolist() == [[0.0, 1.0, 2.0], [0.5, 1.0, 2.0], [1.0, 1.0, 2.0]]
    for x_mm in range(10, 5010):
        drawing.follow(pose(x_mm))
    assert drawing.trace_mm.shape == (4000, 3)
    assert drawing.trace_mm[-1, 0] == 5009.0
    before = drawing.version
    drawing.clear_trace()
    assert drawing.trace_mm.shape == (0, 3)
    assert drawing.version != before


def test_a_path_stays_until_another_one() -> None:
    drawing = Drawing()
    assert drawing.path_mm.shape == (0, 3)
    path = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]])
    first = drawing.version
    drawing.show_path(path)
    assert drawing.path_mm is path
    second = drawing.version
    drawing.clear_path()
    assert drawing.path_mm.shape == (0, 3)
    assert len({first, second, drawing.version}) == 3
