"""Sphinx' settings for `make site`: the site is made of the repository's own pages, as they are.

The source folder is the repository, so that links between pages, README and change log lead where they lead in the
repository. Sphinx with MyST and furo is what cocotb, python-can and pymodbus use. It takes Markdown and checks every
link. No page asks another host for anything, so formulas are MathML, which browsers typeset themselves.
"""

import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from docutils.nodes import Element, SkipNode
from latex2mathml.converter import convert
from pygments.lexers.special import TextLexer
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator

_ROOT: Final = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(_ROOT))

import steptwin  # noqa: E402

project = "StepTwin"
author = "StepTwin contributors"
copyright = author  # noqa: A001
version = release = steptwin.__version__
extensions = ["myst_parser", "sphinx_copybutton"]
root_doc = "docs/index"
include_patterns = ["*.md", "docs/*.md", "docs/papers/*.md"]

myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 5
highlight_language = "text"

copybutton_prompt_text = r"\d?\$ "
copybutton_prompt_is_regexp = True

html_theme = "furo"
html_title = f"StepTwin {version}"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_favicon = "static/favicon.svg"
html_math_renderer = "mathml"
html_show_sourcelink = False
html_copy_source = False

_FIRST_PAGE: Final = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>StepTwin</title>
<meta http-equiv="refresh" content="0; url=docs/index.html"></head>
<body><p><a href="docs/index.html">StepTwin's pages</a></p></body></html>
"""
"""Leads from the site's own address to its first page, whose address has the folder of the pages in it."""
_FOLDER_LINK: Final = re.compile(r"(?<!!)\[([^\]]+)\]\(([^)#:]+)\)")
_WITHOUT_ENTRY: Final = ("CHANGELOG", "CODE_OF_CONDUCT", "CONTRIBUTING", "README", "RELEASING", "SECURITY")
"""Pages that others link to and the menu leaves out."""
_FOUND_BY: Final = {
    "docs/captures": "lost steps, logic analyser, Saleae, sigrok",
    "docs/ci": "fixture, GitHub Actions",
    "docs/driver": "A4988, DRV8825, TMC2209",
    "docs/machines": "DH parameters, calibration",
    "docs/motions": "CSV, spline, time law, resonance",
    "docs/motors": "torque, stall, inertia",
    "docs/panel": "emergency stop, browser",
    "docs/programs": "G-code, grbl, LinuxCNC",
    "docs/robot-files": "own arm, limit switches, own robot, home switch",
    "docs/run-folder": "report.json, VCD, trajectory.csv, edges.npz",
    "docs/shadow": "candump, bus log",
    "docs/warehouse": "drawer, shelf",
}
"""Words that the search finds a page by first, beside those of its headings."""
_TITLE: Final = re.compile(r"^# .*\n", re.MULTILINE)
_LISTED: Final = re.compile(r"^- .*?\]\(([^)]+\.md)\)", re.MULTILINE)


def _menu(section: str) -> str:
    """Return a section of docs/index.md with the pages that its list names as entries of the site's menu."""
    title, _, _ = section.partition("\n")
    entries = "\n".join(page.removesuffix(".md") for page in _LISTED.findall(section))
    return f"## {section.rstrip()}\n\n```{{toctree}}\n:hidden:\n:caption: {title}\n\n{entries}\n```\n\n"


def _read(_app: Sphinx, page: str, source: list[str]) -> None:
    """Name folders, which have no page on the site, without a link; make the menu of docs/index.md's lists."""
    folder = (_ROOT / page).parent
    text = _FOLDER_LINK.sub(
        lambda link: f"`{link[2].lstrip('./')}`" if (folder / link[2]).is_dir() else link[0], source[0]
    )
    if page == root_doc:
        head, *sections = text.split("\n## ")
        text = head + "\n" + "".join(map(_menu, sections))
    elif page in _WITHOUT_ENTRY:
        text = f"---\norphan: true\n---\n\n{text}"
    if words := _FOUND_BY.get(page):
        main = ", ".join(f"!{each}" for each in words.split(", "))
        text = _TITLE.sub(lambda title: f"{title[0]}\n```{{index}} {main}\n```\n", text, count=1)
    source[0] = text


def _give_levels(_app: Sphinx, _page: str, _template: str, context: dict[str, Any], _doctree: object) -> None:
    """Say the level of the menu's headings, which screen readers need: furo's menu, from Sphinx, leaves it out."""
    menu = context.get("furo_navigation_tree", "")
    context["furo_navigation_tree"] = menu.replace('role="heading"', 'role="heading" aria-level="2"')


def _put_formula(display: str) -> Callable[[HTML5Translator, Element], None]:
    def put(page: HTML5Translator, node: Element) -> None:
        page.body.append(convert(node.astext(), display=display))
        raise SkipNode

    return put


def _write_first_page(app: Sphinx, failure: Exception | None) -> None:
    if failure is None:
        (Path(app.outdir) / "index.html").write_text(_FIRST_PAGE, encoding="utf-8")


def setup(app: Sphinx) -> None:
    """Register what is done beside Sphinx' own work."""
    app.add_lexer("csv", TextLexer)
    app.add_html_math_renderer("mathml", (_put_formula("inline"), None), (_put_formula("block"), None))
    app.connect("source-read", _read)
    app.connect("html-page-context", _give_levels, priority=900)  # after the theme's own
    app.connect("build-finished", _write_first_page)
