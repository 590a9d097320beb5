"""Find everything that is wrong in an input at once, instead of stopping at the first error."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from steptwin.host.common.errors import InputError


class UnreadError(Exception):
    """A value was asked for that could not be read; its error has been found already."""


class Findings:
    """The errors of one input; each block under `collecting` ends with its first error, and the work goes on."""

    def __init__(self, messages: list[str] | None = None, place: str = "") -> None:
        self.messages = [] if messages is None else messages
        """Messages of the errors, in the order in which they were found."""
        self._place = place

    def under(self, place: str) -> "Findings":
        """Return findings in a part of the input, whose messages get its place in front; all share one list."""
        return Findings(self.messages, f"{self._place}{place}")

    def add(self, *messages: str) -> None:
        """Keep messages of errors."""
        self.messages.extend(f"{self._place}{message}" for message in messages)

    @contextmanager
    def collecting(self, prefix: str = "") -> Iterator[None]:
        """Keep the messages of an InputError from the block, with a prefix such as its place in the file.

        A block that needs a value that could not be read ends without a message.
        """
        try:
            yield
        except InputError as error:
            self.add(*(f"{prefix}{message}" for message in error.messages))
        except UnreadError:
            return

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
