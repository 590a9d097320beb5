"""The fixture `steptwin_image`, as a pytest plugin (docs/firmware.md).

pytest imports this module at every start where StepTwin is installed. So all else is imported only for a test that
needs an image.
"""

from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from steptwin.features.stm32.tools import ImageTools
    from steptwin.host.twin.board_under_test import BoardUnderTest


@pytest.fixture
def steptwin_image(steptwin_board: "BoardUnderTest") -> "ImageTools":
    """Return the image that `steptwin_board` runs: its USARTs, pins, variables and snapshots."""
    from steptwin.features.stm32.part import ImagePart

    part = steptwin_board.parts.get("stm32")
    if not isinstance(part, ImagePart):
        pytest.fail(
            "steptwin: steptwin_image: the board of this test runs no image; its marker has none in"
            ' extras=[Stm32Options(image="build/fw.elf")]',
            pytrace=False,
        )
    return part.tools(steptwin_board.wait)
