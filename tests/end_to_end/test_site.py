"""The documentation site: built without a warning, whole by itself, without a dead link, and readable by everybody."""

import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path, PurePosixPath
from urllib.parse import quote, unquote, urlsplit

import pytest

from tests.end_to_end.pages import ROOT
from tests.features.panel.page.browser import AXE, CHROMIUM, DRIVER, open_browser

pytest.importorskip("sphinx", reason="sphinx is not installed: the site is not built")
pytest.importorskip("furo", reason="furo is not installed: the site is not built")

pytestmark = pytest.mark.live

LOOKED_AT = ["docs/index", "docs/machines", "docs/command-line", "docs/api", "docs/live-session", "docs/driver"]
"""One page of each kind."""


class Links(HTMLParser):
    """What a page refers to, and the places in it that others may refer to."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.targets: list[str] = []
        self.loaded: list[str] = []
        self.places: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = {name: value or "" for name, value in attrs}
        self.places.add(values.get("id", ""))
        for name in ("href", "src"):
            if name in values:
                self.targets.append(values[name])
                if name == "src" or tag == "link":
                    self.loaded.append(values[name])


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the site as `make site` does: each warning is an error."""
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-c", "docs/site"]
    places = ["-d", str(folder / "doctrees"), ".", str(folder / "html")]
    done = subprocess.run([*command, *places], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder / "html"


@pytest.fixture(scope="module")
def pages(site: Path) -> dict[Path, Links]:
    """Return the links of each page."""
    return {page: Links(page.read_text(encoding="utf-8")) for page in sorted(site.rglob("*.html"))}


def test_every_page_of_the_repository_is_there(site: Path) -> None:
    docs = ROOT / "docs"
    for page in [ROOT / "README.md", *docs.glob("*.md"), *docs.glob("papers/*.md")]:
        assert (site / page.relative_to(ROOT).with_suffix(".html")).is_file(), page


def test_no_link_is_dead(pages: dict[Path, Links]) -> None:
    dead = []
    checked = 0
    for page, links in pages.items():
        for target in links.targets:
            address = urlsplit(target)
            if address.scheme or address.netloc:
                continue
            checked += 1
            there = (page.parent / unquote(address.path)).resolve() if address.path else page
            place = unquote(address.fragment)
            if not there.exists() or (place and there in pages and place not in pages[there].places):
                dead.append(f"{page.name}: {target}")
    assert dead == []
    assert checked > 3000


def test_nothing_is_loaded_from_another_host(site: Path, pages: dict[Path, Links]) -> None:
    loaded = [target for links in pages.values() for target in links.loaded]
    assert [target for target in loaded if urlsplit(target).netloc] == []
    for sheet in site.rglob("*.css"):
        assert not re.search(r"(@import|url\()\s*[\"']?(https?:)?//", sheet.read_text(encoding="utf-8")), sheet


def test_the_search_knows_the_words_of_the_pages(site: Path) -> None:
    index = (site / "searchindex.js").read_text(encoding="utf-8")
    for word in ("corexi", "homing", "tb6560", "waveform"):
        assert word in index, word


SEARCHED = {
    "install": "first-run",
    "first run": "first-run",
    "jog": "live",
    "emergency stop": "panel",
    "own arm": "robot-files",
    "limit switches": "robot-files",
    "AR4": "machines",
    "DH parameters": "machines",
    "G-code": "programs",
    "CSV": "motions",
    "torque": "motors",
    "drawer": "warehouse",
    "lost steps": "captures",
    "Klipper": "captures",
    "pytest": "ci",
    "STM32F103": "firmware",
    "candump": "shadow",
    "ROS 2": "masters",
    "EMCY": "protocol",
    "TB6560": "driver",
    "report.json": "run-folder",
}
"""What a user asks for, and the page that should be found first."""
FIRST_LINK = "return document.querySelector('ul.search li a')?.getAttribute('href')"


@pytest.mark.skipif(CHROMIUM is None or DRIVER is None, reason="Chromium and its driver are not installed")
def test_the_search_finds_the_obvious_page_first(site: Path) -> None:
    found = {}
    with open_browser() as browser:
        for question in SEARCHED:
            browser.driver.get(f"{(site / 'search.html').as_uri()}?q={quote(question)}")
            browser.until(lambda: browser.run(FIRST_LINK) is not None)
            first = browser.run(FIRST_LINK)
            found[question] = PurePosixPath(urlsplit(first).path).stem
    assert found == SEARCHED


@pytest.mark.skipif(CHROMIUM is None or DRIVER is None, reason="Chromium and its driver are not installed")
@pytest.mark.skipif(AXE is None, reason="axe-core-python is not installed: accessibility is not tried")
@pytest.mark.parametrize("size", [(1280, 1000), (390, 900)], ids=["wide", "narrow"])
def test_no_page_has_a_serious_finding_of_axe_light_or_dark(site: Path, size: tuple[int, int]) -> None:
    found = {}
    with open_browser(size) as browser:
        for page in LOOKED_AT:
            browser.driver.get((site / f"{page}.html").as_uri())
            for theme in ("light", "dark"):
                browser.run("document.body.dataset.theme = arguments[0]", theme)
                found[page, theme] = browser.findings()
    assert {where: findings for where, findings in found.items() if findings} == {}
