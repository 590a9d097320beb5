"""Read a text file that a user named."""

from pathlib import Path

from steptwin.host.common.errors import InputError


def read_text(path: str, encoding: str = "utf-8") -> str:
    """Return a file's text; raise InputError, without the path, if it cannot be read or is not UTF-8."""
    try:
        return Path(path).read_text(encoding=encoding)
    except OSError as error:
        raise InputError(error.strerror or "cannot be read") from error
    except UnicodeDecodeError as error:
        raise InputError("is not UTF-8 text") from error
    except ValueError as error:  # the name contains a NUL character
        raise InputError(f"is not a file name: {error}") from error
