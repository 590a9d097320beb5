"""The looks of all pages: their style sheet, the panel's own script and the icon."""

from functools import cache
from pathlib import Path
from typing import Final

from nicegui import ui

_STATIC: Final = Path(__file__).parent / "static"

_PRIMARY: Final = "#1257a8"
"""What is chosen: white text on it can be read in light and dark."""

FAVICON: Final = (
    '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 32 32">'
    '<rect width="32" height="32" rx="7" fill="#1257a8"/>'
    '<path d="M7 25 L12 12 L24 9" fill="none" stroke="#fff" stroke-width="3.4" stroke-linecap="round"'
    ' stroke-linejoin="round"/><circle cx="12" cy="12" r="3" fill="#fff"/>'
    '<circle cx="24" cy="9" r="2.6" fill="#ffb4ae"/></svg>'
)


@cache
def _read(name: str) -> str:
    return (_STATIC / name).read_text(encoding="utf-8")


def apply_theme(*, script: bool = True) -> None:
    """Give the page of this browser the style sheet, and the panel's script unless the page has no machine."""
    ui.colors(primary=_PRIMARY)
    ui.add_head_html(f"<style>{_read('panel.css')}</style>")
    if script:
        ui.add_body_html(f"<script>{_read('panel.js')}</script>")
