"""Find everything that is wrong in an input at once, instead of stopping at the first error."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from steptwin.host.common.errors import InputError


class Findings:
    """The errors of one input; each block under `collecting` ends with its first error, and the work goes on."""

    def __init__(self) -> None:
        self.messages: list[str] = []
        """Messages of the errors, in the order in which they were found."""

    @contextmanager
    def collecting(self, prefix: str = "") -> Iterator[None]:
        """Keep the messages of an InputError from the block, with a prefix such as its place in the file."""
        try:
            yield
        except InputError as error:
            self.messages.extend(f"{prefix}{message}" for message in error.messages)

    def raise_first(self) -> None:
        """Raise one InputError with all messages if there are any, for a caller that needs the input to be right.

        The first message is its text.
        """
        if self.messages:
            raise InputError(*self.messages)


def check_all(*checks: Callable[[], object]) -> None:
    """Make every check; raise one InputError with the messages of all that failed."""
    findings = Findings()
    for check in checks:
        with findings.collecting():
            check()
    findings.raise_first()
