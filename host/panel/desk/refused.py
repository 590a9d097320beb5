"""The error with which the desk refuses what a page asks for."""

from steptwin.host.common.errors import InputError


class RefusedError(InputError):
    """The desk does not do what was asked for, and nothing has changed; the message says why in one line."""
