"""Find everything that is wrong in an input at once, instead of stopping at the first error."""

from collections.abc import Iterator
from contextlib import contextmanager

from steptwin.host.common.errors import InputError


class Findings:
    """The errors of one input; each block under `collecting` adds at most one, and the work goes on after it."""

    def __init__(self) -> None:
        self.messages: list[str] = []
        """Messages of the errors, in the order in which they were found."""

    @contextmanager
    def collecting(self, prefix: str = "") -> Iterator[None]:
        """Keep the message of an InputError from the block, with a prefix such as its place in the file."""
        try:
            yield
        except InputError as error:
            self.messages.append(f"{prefix}{error}")

    def raise_first(self) -> None:
        """Raise InputError with the first message if there is any, for a caller that needs the input to be right."""
        if self.messages:
            raise InputError(self.messages[0])
