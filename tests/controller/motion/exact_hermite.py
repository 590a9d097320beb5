"""A cubic Hermite segment in exact arithmetic, to check the kernel and the cyclic mode against."""

from fractions import Fraction


class ExactHermite:
    """A cubic Hermite segment over rationals: positions in steps, velocities in steps per ms, time in ms."""

    def __init__(self, p0: Fraction, v0: Fraction, p1: Fraction, v1: Fraction, dt_ms: Fraction | int) -> None:
        self.p0, self.v0, self.p1, self.v1, self.dt_ms = p0, v0, p1, v1, dt_ms

    def position(self, t_ms: Fraction) -> Fraction:
        s = t_ms / self.dt_ms
        return (
            self.p0 * (1 + 2 * s) * (1 - s) ** 2
            + self.v0 * self.dt_ms * s * (1 - s) ** 2
            + self.p1 * s * s * (3 - 2 * s)
            + self.v1 * self.dt_ms * s * s * (s - 1)
        )

    def acceleration_max(self) -> Fraction:
        """Largest |p''| in steps per ms^2: it is linear in time, so it lies at an end."""
        d, t = self.p1 - self.p0, self.dt_ms
        at_start = (6 * d / t - 4 * self.v0 - 2 * self.v1) / t
        at_end = (-6 * d / t + 2 * self.v0 + 4 * self.v1) / t
        return max(abs(at_start), abs(at_end))

    def speed_max(self) -> Fraction:
        """A bound on |p'|: the Bernstein coefficients of the velocity."""
        return max(abs(self.v0), abs(3 * (self.p1 - self.p0) / self.dt_ms - self.v0 - self.v1), abs(self.v1))
