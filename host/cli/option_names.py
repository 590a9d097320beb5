"""Replace the library's parameters by the command line's options in error messages."""

import re
from collections.abc import Iterator
from contextlib import contextmanager

from steptwin.host.common.errors import StepTwinError


@contextmanager
def naming_options(*parameters: str, **options: str) -> Iterator[None]:
    """Replace parameters by options in every error from inside: `port=80` becomes `--port 80`.

    Args:
        parameters: those whose option has the same name, such as `allow_remote` for `--allow-remote`.
        options: the option of each other parameter.
    """
    names = {name: f"--{name.replace('_', '-')}" for name in parameters} | options
    named = re.compile(rf"\b({'|'.join(names)})=(True\b)?")

    def option(found: re.Match[str]) -> str:
        return names[found[1]] + ("" if found[2] else " ")

    try:
        yield
    except StepTwinError as error:
        raise type(error)(named.sub(option, str(error))) from error
