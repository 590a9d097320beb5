"""Shorten a session that fails: leave out steps as long as it still fails (delta debugging; Zeller, 1999)."""

from collections.abc import Callable

from tests.emulator.random_host.session import Session, Step

Fails = Callable[[Session], bool]


def shrunk(session: Session, fails: Fails) -> Session:
    """Return a session of which no step can be left out; the steps that stay keep their instants."""
    steps = list(session.steps[:-1])
    part = len(steps) // 2
    while part:
        shorter = _without_parts(session, steps, part, fails)
        part = part // 2 if len(shorter) == len(steps) else min(part, len(shorter) // 2)
        steps = shorter
    return session.only(steps)


def _without_parts(session: Session, steps: list[Step], part: int, fails: Fails) -> list[Step]:
    """Leave out each stretch of `part` steps without which the session fails as well, from the end on."""
    for begin in reversed(range(0, len(steps), part)):
        rest = steps[:begin] + steps[begin + part :]
        if fails(session.only(rest)):
            steps = rest
    return steps
