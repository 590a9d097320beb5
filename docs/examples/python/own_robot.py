"""Draw a star with a plotter of one's own, and see every pulse verified: `python own_robot.py`."""

from pathlib import Path

import numpy as np

import steptwin

PLOTTER = Path(__file__).with_name("plotter.toml")
CENTRE_MM = np.array([150.0, 150.0])
RADIUS_MM = 60.0


def star(robot: steptwin.Robot) -> steptwin.Motion:
    """Return the pen's way: from the home position to the star, its five lines, and up again."""
    angles_rad = np.radians(90 + 144 * np.arange(6))
    corners_mm = CENTRE_MM + RADIUS_MM * np.column_stack([np.cos(angles_rad), np.sin(angles_rad)])
    moves = steptwin.Composer(robot, np.array(robot.home))
    moves.go(np.array([*corners_mm[0], 20.0]))
    moves.switch("pen", on=True)
    for x_mm, y_mm in corners_mm[1:]:
        moves.go_some({"X": x_mm, "Y": y_mm})
    moves.switch("pen", on=False)
    moves.go(np.array(robot.home))
    return moves.sequence()


def main() -> None:
    """Plan, run on the emulated board, print the verdict."""
    robot = steptwin.load_robot(str(PLOTTER))
    outcome = steptwin.execute(steptwin.plan(robot, star(robot)), "star")
    for axis in outcome.report.axes:
        print(f"{axis.name}: {axis.pulses} pulses, at most {axis.peak_rate_hz:.0f} Hz, {axis.violations} broken limits")
    print("PASSED" if outcome.passed else f"FAILED: {outcome.report.reasons}")


if __name__ == "__main__":
    main()
