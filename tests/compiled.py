"""Tell whether the modules under test are compiled, as for `make test-compiled`, and leave out what cannot be then.

Some tests put an observer in the place of a method of ours, or derive a class of their own. Compiled classes are closed
to that.
"""

from pathlib import Path
from typing import Final

import pytest

from steptwin.emulator import simulation

COMPILED: Final = Path(str(simulation.__file__)).suffix != ".py"
_REASON: Final = "looks into a class that is closed when compiled"

on_sources_only: Final = pytest.mark.skipif(COMPILED, reason=_REASON)


def skip_if_compiled() -> None:
    """Skip the test that calls this if the modules are compiled."""
    if COMPILED:
        pytest.skip(_REASON)
