"""Check that the extra `panel` is installed: commands share this, but import no other command's module."""

from importlib.util import find_spec

from steptwin.host.common.errors import InputError


def require_extra() -> None:
    """Raise InputError, with the remedy, unless the extra `panel` is installed."""
    if find_spec("nicegui") is None:
        raise InputError("the panel is not installed: pip install 'steptwin[panel]'")
