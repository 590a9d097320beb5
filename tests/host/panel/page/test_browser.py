"""The panel in a real Chromium, beside a served board: what only a browser can show.

Skipped where Chromium and its driver are not installed, as on Debian by `apt install chromium chromium-driver`.
"""

import time
from collections.abc import Iterator

import pytest

pytest.importorskip("nicegui", reason="the extra `panel` is not installed")
pytest.importorskip("selenium", reason="selenium is not installed")

from tests.host.panel.page.browser import CHROMIUM, DRIVER, Browser, open_browser, panel_of

pytestmark = pytest.mark.skipif(
    CHROMIUM is None or DRIVER is None, reason="Chromium and its driver are not installed: the panel is not tried in it"
)

NO_3D = "--disable-3d-apis"
"""Without a graphics card the 3D view would take most of a processor; one browser has it."""
STANDS = 0.01
"""Difference of two positions that is none."""


@pytest.fixture(scope="module")
def url(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    with panel_of("lab-scara", tmp_path_factory.mktemp("panel")) as url:
        yield url


@pytest.fixture(scope="module")
def operator(url: str) -> Iterator[Browser]:
    """Return the browser that operates the machine, which has the 3D view."""
    with open_browser() as browser:
        browser.open(url)
        yield browser


@pytest.fixture(scope="module")
def watcher(url: str, operator: Browser) -> Iterator[Browser]:
    """Return a second browser, as wide as a phone."""
    assert operator.shows("lab-scara")
    with open_browser((412, 915), NO_3D) as browser:
        browser.open(url)
        browser.resize((412, 915))
        yield browser


def hold(browser: Browser, label: str) -> None:
    """Press a jog button and hold it until the joint moves."""
    before = browser.position(1)
    browser.run(
        """const button = document.querySelector(`[aria-label="${arguments[0]}"]`);
        const { left, top } = button.getBoundingClientRect();
        const press = { bubbles: true, button: 0, pointerId: 1, clientX: left + 3, clientY: top + 3 };
        button.dispatchEvent(new PointerEvent("pointerdown", press));""",
        label,
    )
    browser.until(lambda: abs(browser.position(1) - before) > 0.2)


def comes_to_rest(browser: Browser) -> None:
    """Wait until the joint stands, and see that it goes on standing."""
    places = [browser.position(1)]

    def stands() -> bool:
        time.sleep(0.15)
        places.append(browser.position(1))
        return abs(places[-1] - places[-2]) < STANDS

    browser.until(stands, 5.0)
    assert stands()


def emergency_stopped(browser: Browser) -> bool:
    return browser.shows("Emergency stop: nothing moves until the reset.")


def test_letting_go_leaving_and_losing_the_focus_end_a_jog(operator: Browser) -> None:
    for event in (
        "document.dispatchEvent(new PointerEvent('pointerup', { bubbles: true }))",
        "window.dispatchEvent(new Event('blur'))",
        "window.dispatchEvent(new Event('pagehide'))",
        "document.querySelector('.held').dispatchEvent(new PointerEvent('pointerout', { bubbles: true }))",
        "window.emitEvent = () => {}",  # the page falls silent, with the button still held
    ):
        hold(operator, "jog th2 forward")
        operator.run(event)
        comes_to_rest(operator)
    operator.driver.refresh()
    operator.until(lambda: operator.shows("you operate"))


def test_any_browser_stops_in_an_emergency_by_click_and_by_key(operator: Browser, watcher: Browser) -> None:
    from selenium.webdriver.common.keys import Keys

    def by_key() -> None:
        watcher.driver.switch_to.active_element.send_keys(Keys.ESCAPE)

    def by_click() -> None:
        watcher.driver.find_element("css selector", "[data-estop]").click()

    assert watcher.shows("operates, you watch")
    for stop in (by_click, by_key):
        hold(operator, "jog th2 backward")
        stop()
        operator.until(lambda: emergency_stopped(operator))
        comes_to_rest(operator)
        hold_again = "document.querySelector('[aria-label=\"jog th2 backward\"]').classList.contains('held')"
        operator.run("document.dispatchEvent(new PointerEvent('pointerup', { bubbles: true }))")
        assert not operator.run(f"return {hold_again}")
        operator.click("Reset")
        operator.until(lambda: not emergency_stopped(operator))


def test_nothing_comes_from_another_host(operator: Browser, url: str) -> None:
    asked = operator.run("return performance.getEntriesByType('resource').map((entry) => entry.name)")
    assert len(asked) > 10
    assert [name for name in asked if not name.startswith((url, url.replace("http", "ws"), "data:", "blob:"))] == []


def test_a_phone_shows_the_emergency_stop_first_and_all_of_the_width(watcher: Browser) -> None:
    width, shown, top = watcher.run(
        """const stop = document.querySelector("[data-estop]").getBoundingClientRect();
        return [document.documentElement.scrollWidth, innerWidth, stop.top];"""
    )
    assert width <= shown == 412
    assert top < 20


def test_everything_has_a_name_and_can_be_read(operator: Browser) -> None:
    """The rules of WCAG 2.1 that programs can check, and that matter here: names, one heading of the page, contrast."""
    nameless = operator.run(
        """const named = (e) => (e.getAttribute("aria-label") || e.innerText || e.labels?.[0]?.innerText || "").trim();
        return [...document.querySelectorAll("button, input, select, canvas[role], [role=img], [role=radio]")]
            .filter((e) => e.offsetParent && !named(e) && !e.closest("[aria-label]"))
            .map((e) => e.outerHTML.slice(0, 200));"""
    )
    assert nameless == []
    assert operator.run("return document.documentElement.lang") == "en-US"
    assert operator.run("return document.querySelectorAll('[aria-level=\"1\"], h1').length") == 1
    for _ in range(2):
        operator.until(lambda: operator.run(_TOO_FAINT) == [], 5.0)  # colours change little by little
        operator.dark()


_TOO_FAINT = """
const parse = (text) => text.match(/[\\d.]+/g).map(Number);
const light = ([r, g, b]) => {
  const [R, G, B] = [r, g, b].map((v) => ((v /= 255) <= 0.03928 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4));
  return 0.2126 * R + 0.7152 * G + 0.0722 * B;
};
const ground = (element) => {
  for (let e = element; e; e = e.parentElement) {
    const color = parse(getComputedStyle(e).backgroundColor);
    if (color.length < 4 || color[3] > 0.99) return color;
  }
  return [255, 255, 255];
};
const faint = [];
for (const e of document.querySelectorAll("body *")) {
  const text = [...e.childNodes].some((node) => node.nodeType === 3 && node.textContent.trim());
  if (!text || !e.offsetParent || e.closest("[disabled], .disabled, [aria-hidden=true], .off")) continue;
  const [a, b] = [light(parse(getComputedStyle(e).color)), light(ground(e))];
  const ratio = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
  if (ratio < 4.5) faint.push(`${e.innerText.slice(0, 40)}: ${ratio.toFixed(2)}`);
}
return faint;
"""
