"""Make the pictures of docs/panel.md in a real browser: `python -m docs.generate.panel_pictures`.

They are not part of `python -m docs.generate`, since they need Chromium, a display's worth of time and a live board.
"""

import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from PIL import Image

from tests.host.panel.page.browser import Browser, open_browser, panel_of

FOLDER: Final = Path(__file__).parent.parent / "pictures" / "panel"
_SIZE: Final = (1440, 1000)
_PHONE: Final = (412, 915)
_COLOURS: Final = 128
"""Enough for the page, and a third of the bytes."""


def main() -> None:
    """Take a picture of every view, two of them dark, one on a phone."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory() as folder, panel_of("lab-scara", Path(folder)) as url, open_browser(_SIZE) as browser:
        browser.open(url)
        browser.home()
        browser.click("Clear trace")  # of the homing
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
    path = FOLDER / f"{name}.png"
    browser.picture(path)
    with Image.open(path) as picture:
        few = picture.convert("RGB").quantize(_COLOURS)
    few.save(path, optimize=True)


if __name__ == "__main__":
    main()
