"""Render docs/robot-files.md: the kinds of mechanisms with their drawings and dimensions."""

from typing import Final

from docs.generate.pieces import DOCS, filled
from docs.generate.robot_drawings import drawing
from steptwin.host.papers.markdown import table
from steptwin.host.robots.kinematics.dimension import dimensions, meaning
from steptwin.host.robots.kinematics.kinds import KINDS
from steptwin.host.robots.new_file import usual_dimensions, usual_joints

ROBOT_FILES_PAGE: Final = DOCS / "robot-files.md"

_NOTICE: Final = (
    "<!-- Made by `make docs` from docs/robot-files/robot-files.md and the kinds' dimensions: change those. -->"
)


def render_robot_files() -> str:
    """Return the whole page; it ends with a newline."""
    page = filled(DOCS / "robot-files" / "robot-files.md", {"kinds": lambda _: "\n\n".join(map(_kind, KINDS))})
    return f"{_NOTICE}\n\n{page}\n"


def _kind(name: str) -> str:
    kind = KINDS[name]
    joints = " ".join(joint.name for joint in usual_joints(name, usual_dimensions(name)))
    rows = [
        [f"`{key}`", meaning(field), _text(field.metadata["usual"])] for key, field in dimensions(kind.geometry).items()
    ]
    picture = drawing(name).relative_to(DOCS)
    return "\n\n".join(
        [
            f"### `{name}`",
            f"{kind.summary[0].upper()}{kind.summary[1:]}. Joints: `{joints}`.",
            f"![Dimensions and joints of {name}]({picture})",
            table(["key", "meaning", "in a new file"], rows, text_columns=3),
        ]
    )


def _text(value: object) -> str:
    if isinstance(value, bool):
        return "`true`" if value else "`false`"
    return f"`{value:g}`" if isinstance(value, float) else f'`"{value}"`'
