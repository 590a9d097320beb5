"""Name the defaults of socketcand, the TCP protocol by which programs reach a served board."""

from typing import Final

PORT: Final = 29536
"""TCP port that socketcand itself uses."""
CHANNEL: Final = "vcan0"
"""Name that a served board gives its bus; a real socketcand server has the names of its interfaces."""
LOOPBACK: Final = "127.0.0.1"
"""Address at which a board is served by default: only programs on the same machine reach it."""
