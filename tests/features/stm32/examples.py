"""The examples of examples/stm32-image: images as they are in the repository, and their robot."""

from pathlib import Path
from typing import Final

EXAMPLES: Final = Path(__file__).parents[3] / "examples" / "stm32-image"
ROBOT: Final = EXAMPLES / "two-axes.toml"
