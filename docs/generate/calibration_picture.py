"""Draw the picture of docs/calibration.md from the page's own example."""

import re
from functools import partial
from typing import Final

from docs.generate.pictures import write_picture
from docs.generate.pieces import DOCS
from steptwin.host.record.plots.residuals import draw_residuals
from steptwin.host.robots import parse_robot
from steptwin.host.robots.calibration import identify_errors, simulate_measurements
from steptwin.host.robots.kinematics.chain import Chain
from steptwin.host.robots.new_file import robot_text, with_settings

_KIND: Final = "calibration-scara"
_NAME: Final = "my-arm"
_ERRORS: Final = re.compile(r"^```toml\n(.*?)^```", re.MULTILINE | re.DOTALL)
_MEASURE: Final = re.compile(r"--poses (\d+) --noise-mm (\S+) --seed (\d+)")


def write_calibration_picture() -> None:
    """Calibrate the page's arm by the measurements that the page's command simulates."""
    page = (DOCS / "calibration.md").read_text(encoding="utf-8")
    errors, measure = _ERRORS.search(page), _MEASURE.search(page)
    if not (errors and measure):
        raise ValueError("docs/calibration.md has no errors.toml, or no steptwin measure")
    text = robot_text(_NAME, _KIND, *with_settings(_KIND, {}))
    nominal, real = (parse_robot(each, _NAME) for each in (text, text + errors[1]))
    measured = simulate_measurements(real, int(measure[1]), float(measure[2]), int(measure[3]))
    found = identify_errors(Chain.of(nominal), measured)
    write_picture(DOCS / "pictures" / "calibration-residuals.png", partial(draw_residuals, _NAME, found))
