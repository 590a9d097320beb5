"""A recording without any plan is shown by its counts."""

from pathlib import Path

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.features.view.model import Replay
from tests.host.twin.live.live_session import JOINT, NMT_START, ROBOT, LiveSession
from tests.host.twin.live.test_live_plan import HALF_A_STEP_DEG, jog


@pytest.mark.slow
def test_a_jog_is_shown(fast_kernel: Kernel, tmp_path: Path) -> None:
    session = LiveSession(fast_kernel, tmp_path)
    session.send(NMT_START)
    jog(session)
    session.end()
    replay = Replay.of_folder(tmp_path)
    end = replay.at(replay.record.to_counts)
    assert not end.has_plan
    assert end.joints[JOINT].counted == pytest.approx(ROBOT.home[JOINT] + 360 / 200 / 5, abs=HALF_A_STEP_DEG)  # a step
    assert (replay.path.errors_mm == 0.0).all()
