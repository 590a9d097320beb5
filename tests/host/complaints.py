"""The message with which bad input is refused."""

from collections.abc import Callable

import pytest

from steptwin.host.common.errors import InputError
from tests.messages import refused_with


def complaint_of(call: Callable[[], object]) -> str:
    """Return the message of the InputError that a call raises: a single line, which stands in the golden file."""
    with pytest.raises(InputError) as caught:
        call()
    message = str(caught.value)
    assert len(message.splitlines()) == 1
    return refused_with(message)
