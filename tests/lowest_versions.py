"""Print the lowest versions that pyproject.toml allows, of all dependencies and extras, as constraints for pip.

`make test-lowest` installs these versions, with which a user's own constraints may leave StepTwin.
"""

import re
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

_AT_LEAST = re.compile(r"([A-Za-z0-9_.-]+)>=([0-9.]+)(,<[0-9.]+)?")


def lowest_versions(pyproject: Path) -> Iterator[str]:
    """Yield `name==version` for each dependency; raise ValueError for one without a lower bound."""
    project = tomllib.loads(pyproject.read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"].values()
    for requirement in [*project["dependencies"], *(each for extra in extras for each in extra)]:
        bounds = _AT_LEAST.fullmatch(requirement)
        if not bounds:
            raise ValueError(f"{requirement}: has no lower bound")
        yield f"{bounds[1]}=={bounds[2]}"


if __name__ == "__main__":
    sys.stdout.writelines(f"{each}\n" for each in lowest_versions(Path(__file__).parents[1] / "pyproject.toml"))
