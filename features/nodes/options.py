"""Options of an emulated machine's further nodes."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from steptwin.host.common.errors import InputError
from steptwin.host.common.numbers import whole
from steptwin.host.twin.machine.machine_options import SPELLING, Spelling


def _node_files(texts: list[str]) -> dict[int, str]:
    files: dict[int, str] = {}
    for text in texts:
        word, equals, path = text.partition("=")
        try:
            node_id = whole(word, 0)
        except ValueError:
            raise InputError(f"nodes={text}: {word!r} is no node id, as in 0x40=device.eds") from None
        if not equals or not path:
            raise InputError(f"nodes={text}: does not name an EDS, as in 0x40=device.eds")
        if node_id in files:
            raise InputError(f"nodes={text}: node 0x{node_id:02X} is given twice")
        files[node_id] = path
    return files


_NODES: Final = Spelling(
    key="node",
    value="ID=EDS",
    example='{0x40: "io.eds"}',
    says="Put a further CANopen node, as simple as this EDS, on the bus (docs/masters.md); repeatable.",
    read=_node_files,
    repeatable=True,
    served=True,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeOptions:
    """EDS file of each further node on the bus, by its id; None: no node."""

    nodes: Mapping[int, Path | str] | None = field(default=None, metadata={SPELLING: _NODES})

    def placed(self, folder: Path) -> "NodeOptions":
        """Return the options with relative paths resolved in a folder."""
        return NodeOptions(nodes={node_id: folder / path for node_id, path in (self.nodes or {}).items()})

    def over(self, other: "NodeOptions") -> "NodeOptions":
        """Return `other`, with this object's nodes in place of its own if there are any."""
        return other if self.nodes is None else self
