"""Look at the law of a motion, which is of a known kind."""

from typing import TypeVar

from steptwin.host.planning.motion import JointLaw, Motion

Kind = TypeVar("Kind", bound=JointLaw)


def law_of(motion: Motion, kind: type[Kind]) -> Kind:
    """Return a motion's law, after a check of its class."""
    assert isinstance(motion.law, kind)
    return motion.law
