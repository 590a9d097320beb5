"""The message with which bad input is refused."""

from collections.abc import Callable

import pytest

from steptwin.host.common.errors import InputError


def complaint_of(call: Callable[[], object]) -> str:
    """Return the message of the InputError that a call raises; it must be a single line."""
    with pytest.raises(InputError) as caught:
        call()
    message = str(caught.value)
    assert len(message.splitlines()) == 1
    return message
