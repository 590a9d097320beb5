"""Replace the library's parameters by the command line's options in error messages."""

import re
from collections.abc import Iterator
from contextlib import contextmanager

from steptwin.host.common.errors import StepTwinError


@contextmanager
def naming_options(*parameters: str, **options: str) -> Iterator[None]:
    """Replace parameters by options in every error from inside, as `with_options` does."""
    try:
        yield
    except StepTwinError as error:
        raise type(error)(with_options(str(error), *parameters, **options)) from error


def with_options(message: str, *parameters: str, **options: str) -> str:
    """Replace parameters by options in a message: `port=80` becomes `--port 80`.

    Args:
        message: the message.
        parameters: those whose option has the same name, such as `allow_remote` for `--allow-remote`.
        options: the option of each other parameter.
    """
    names = {name: f"--{name.replace('_', '-')}" for name in parameters} | options
    named = re.compile(rf"\b({'|'.join(names)})=(True\b)?")

    def option(found: re.Match[str]) -> str:
        return names[found[1]] + ("" if found[2] else " ")

    return named.sub(option, message)
