"""Make the pictures of docs/panel.md in a real browser: `python -m docs.generate.panel_pictures`.

They are not part of `python -m docs.generate`, since they need Chromium, a display's worth of time and a live board.
"""

import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from PIL import Image

from steptwin.host.robots import load_robot
from tests.features.panel.page.browser import NOT_SEEN, Browser, open_browser, panel_of

FOLDER: Final = Path(__file__).parent.parent / "pictures" / "panel"
_SIZE: Final = (1440, 1000)
_PHONE: Final = (412, 915)
_Q0: Final = "return document.querySelector('[data-live=q0]').textContent"
"""The first joint's position, as the page shows it."""
_CLOSER_S: Final = 4.0
"""Time after which the camera has come closer, since less is to be seen."""
_COLOURS: Final = 128
"""Enough for the page, and a third of the bytes."""


def main() -> None:
    """Take a picture of every view, two of them dark, one on a phone, and two of a six-axis arm."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    _small_arm()
    _six_axis_arm()


def _six_axis_arm() -> None:
    """Let the AR4 stand at home, known without homing, and show its frames and a pose."""
    home = " ".join(f"{position:g}" for position in load_robot("ar4-mk3").home)
    with (
        TemporaryDirectory() as folder,
        panel_of("ar4-mk3", Path(folder), f"--machine=stand-at={home}") as url,
        open_browser(_SIZE) as browser,
    ):
        browser.open(url)
        browser.tab("Move")
        browser.click("Home position")
        browser.click_until("Declare as position", lambda: browser.run(_Q0) != "unknown")
        browser.click("Tool pose")
        browser.click("Fill in present position")
        _picture(browser, "six-axes-move")
        browser.tab("Jog")
        browser.click("Frames")
        browser.click("its own")
        _picture(browser, "six-axes-jog")


def _small_arm() -> None:
    with TemporaryDirectory() as folder, panel_of("lab-scara", Path(folder)) as url, open_browser(_SIZE) as browser:
        browser.open(url)
        browser.home()
        browser.click("Clear trace")  # of the homing
        time.sleep(_CLOSER_S)
        for name in ("Jog", "Move", "Run", "Outputs", "Settings", "Hardware"):
            browser.tab(name)
            _picture(browser, name.lower())
        browser.tab("Run")
        browser.click("Preview")
        browser.until(lambda: browser.shows("It keeps all limits"), 30.0)
        browser.click("Run")
        time.sleep(10.0)
        _picture(browser, "running")
        browser.until(lambda: browser.activity() == "")
        browser.tab("Result")
        _picture(browser, "result")
        browser.dark()
        _picture(browser, "result-dark")
        browser.tab("Jog")
        _picture(browser, "jog-dark")
        browser.resize(_PHONE)
        _picture(browser, "phone")


def _picture(browser: Browser, name: str) -> None:
    time.sleep(1.0)  # the 3D view and the plots draw a little later
    browser.until(lambda: browser.activity() != NOT_SEEN)  # on a busy computer the page is grey now and then
    path = FOLDER / f"{name}.png"
    browser.picture(path)
    with Image.open(path) as picture:
        few = picture.convert("RGB").quantize(_COLOURS)
    few.save(path, optimize=True)


if __name__ == "__main__":
    main()
