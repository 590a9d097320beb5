"""The arm of a stored run in three dimensions, with its planned path and the counted one; of two runs both arms."""

from typing import Final

import numpy as np

from steptwin.host.panel.page.elements import card, line
from steptwin.host.panel.page.scene import Arm, ArmScene
from steptwin.host.panel.page.scene_card import camera_buttons, drawing_switch, legend
from steptwin.host.panel.replay import Replay

_ARMS: Final[tuple[Arm, ...]] = ("arm", "other")
_POINTS: Final = 800
"""Points of a path: as fine as a screen."""


class ReplayScene:
    """The scene; the first run's arm is in the arm's colour, the second's in another."""

    def __init__(self, replays: tuple[Replay, ...]) -> None:
        self._replays = replays
        path = replays[0].path
        gain = path.gain
        with card(classes="flush"):
            with line("between scene-bar"):
                with line("tight"):
                    camera_buttons(lambda: self._scene)
                    drawing_switch(lambda: self._scene)
                with line():
                    legend("--plan", "planned path")
                    legend("--trace", f"counted path, error x {gain:g}" if gain > 1.0 else "counted path")
                    if len(replays) == 2:
                        legend("--other", "second run")
            self._scene = ArmScene(replays[0].run.robot, np.concatenate([each.extent_mm for each in replays]))
        self._boxes_move = any(box.held_by for box in replays[0].run.robot.boxes.values())
        chosen = np.linspace(0, len(path.planned_mm) - 1, _POINTS).astype(np.int64)
        self._scene.show_line("plan", path.planned_mm[chosen])
        counted_mm = path.counted_mm(gain)[chosen]
        self._scene.show_line("trace", counted_mm[np.isfinite(counted_mm).all(axis=1)])

    def show(self, t_s: float) -> None:
        """Show every run's arm at a time."""
        for arm, replay in zip(_ARMS, self._replays, strict=False):
            links = replay.machine.links(np.array([t_s]))
            if all(np.isfinite(link.points_mm).all() for link in links):  # else its counts have pulled it apart
                self._scene.show_arm(arm, [link.points_mm[0] for link in links])
            else:
                self._scene.clear_shape(arm)
        if self._boxes_move:
            shifts_mm = self._replays[0].machine.box_shifts_mm(np.array([t_s]))
            self._scene.move_boxes(shift_mm[0] for shift_mm in shifts_mm.values())
