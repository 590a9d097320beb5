"""The looks of a replay beside those of all pages."""

from typing import Final

STYLE: Final = """
body.body--dark { color-scheme: dark; }
.transport { margin: 12px 16px 0; width: auto; max-width: 1768px; }
@media (min-width: 1800px) { .transport { margin: 12px auto 0; } }
.transport .strip svg { display: block; }
.transport .q-slider { margin: 0; }
.clock { font-size: 20px; font-weight: 600; min-width: 11em; }
.number.left { text-align: left; }
.w-speed { width: 96px; }
.lanes { display: flex; gap: 10px; font-size: 13px; margin-top: 8px; }
.lane-names { flex: 0 0 auto; min-width: 72px; }
.lane-names div { display: flex; align-items: center; white-space: nowrap; }
.lane-picture { flex: 1 1 auto; min-width: 0; }
.lane-picture svg { display: block; }
.mark.q-btn.plain { font-weight: 400; width: 100%; text-align: left; margin-bottom: 4px; min-height: 32px; }
.mark .q-btn__content { justify-content: flex-start; text-align: left; flex-wrap: wrap; }
.events { max-height: 300px; }
@media (max-width: 900px) { .transport { margin: 8px 8px 0; } .clock { font-size: 17px; } }
"""
