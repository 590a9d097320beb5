"""The fixture `steptwin_image`, in tests of other projects."""

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.features.stm32.options import Stm32Options
from steptwin.features.stm32.tools import ImageTools
from steptwin.host.twin.board_under_test import BoardUnderTest
from tests.features.stm32.examples import EXAMPLES, ROBOT
from tests.host.twin.plugin_runs import load_all, outcomes

pytest_plugins = ["pytester"]


@pytest.fixture(autouse=True, scope="module")
def loaded(fast_kernel: Kernel) -> None:
    load_all(fast_kernel)


@pytest.mark.steptwin(str(ROBOT), extras=[Stm32Options(image=EXAMPLES / "compare_stepper.elf")])
@pytest.mark.slow  # numba loads the chip
def test_it_is_the_image_of_the_board(steptwin_board: BoardUnderTest, steptwin_image: ImageTools) -> None:
    assert steptwin_image.uart.expect("ready") == "ready"
    before_s = steptwin_board.now_s()
    steptwin_image.wait(0.01)
    assert steptwin_board.now_s() - before_s == pytest.approx(0.01)


def test_a_board_without_an_image_is_told(pytester: pytest.Pytester) -> None:
    code = """
        import pytest

        @pytest.mark.steptwin("turntable")
        def test_none(steptwin_image):
            pass
        """
    result = outcomes(pytester, code)
    result.assert_outcomes(errors=1)
    assert "steptwin_image: the board of this test runs no image" in result.stdout.str()
