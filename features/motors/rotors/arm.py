"""The mechanism that motors turn, as data: a tree of bodies, whose joints follow the rotors."""

from dataclasses import dataclass

from steptwin.emulator.board.edges import FloatArray
from steptwin.features.motors.rotors.following import NO_PAIR, FollowingSliders

BASE = -1
"""Parent of a body that hangs on the base."""


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """A rigid body and the joint to its parent.

    The joint turns about, or slides along, the z axis of its frame; `fixed` places that frame in the parent's.

    Attributes:
        parent: index of the parent, less than its own, or BASE.
        slides: True if the joint slides.
        fixed: shape (4, 4), the homogeneous transform from the joint's frame at 0 to the parent's, in m.
        mass_kg: mass.
        centre_m: shape (3,), centre of mass in the body's frame.
        inertia_kgm2: shape (3, 3), about the centre of mass.
    """

    parent: int
    slides: bool
    fixed: FloatArray
    mass_kg: float
    centre_m: FloatArray
    inertia_kgm2: FloatArray

    def numbers(self) -> list[float]:
        """Return the body as numbers for `mechanics`."""
        tensor = self.inertia_kgm2
        return [
            float(self.parent),
            float(self.slides),
            *self.fixed[:3, :3].ravel().tolist(),
            *self.fixed[:3, 3].tolist(),
            self.mass_kg,
            *self.centre_m.tolist(),
            *(float(tensor[row, column]) for row, column in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))),
        ]


@dataclass(frozen=True, slots=True, eq=False)
class Arm:
    """A mechanism of `bodies` with joints that follow the rotors' angles in rad.

    Attributes:
        bodies: the tree, parents first.
        slopes: shape (bodies, axes), rad or m of each joint for each rad of a rotor.
        offsets: shape (bodies,), the joints' positions with all rotors at 0.
        pair: two sliders and their platform, which follows them in no fixed proportion.
    """

    bodies: tuple[Body, ...]
    slopes: FloatArray
    offsets: FloatArray
    pair: FollowingSliders | None = None

    @property
    def pair_numbers(self) -> list[float]:
        """Numbers of the pair for `following`."""
        return list(NO_PAIR) if self.pair is None else self.pair.numbers()
