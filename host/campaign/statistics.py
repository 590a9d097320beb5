"""How sure a pass rate is after so many runs."""

from math import sqrt
from typing import Final, NamedTuple

_Z: Final = 1.959963984540054
"""The normal distribution's 97.5 % quantile: intervals of 95 %."""


class PassRate(NamedTuple):
    """So many of some runs passed."""

    passed: int
    runs: int

    @property
    def rate(self) -> float:
        """Part of the runs that passed; NaN without runs."""
        return self.passed / self.runs if self.runs else float("nan")

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's score interval of 95 % for the true rate (E. B. Wilson, JASA 22, 1927); 0 to 1 without runs.

        It stays within 0 and 1 and is right for few runs and for rates near 1, as campaigns have them: after n runs
        that all passed the lower end is n / (n + 3.84).
        """
        if not self.runs:
            return 0.0, 1.0
        n, p, z2 = self.runs, self.passed / self.runs, _Z * _Z
        middle = (p + z2 / (2 * n)) / (1 + z2 / n)
        half = _Z / (1 + z2 / n) * sqrt(p * (1 - p) / n + z2 / (4 * n * n))
        # The exact ends of these two cases are 0 and 1, which rounding would miss.
        lower = 0.0 if self.passed == 0 else middle - half
        upper = 1.0 if self.passed == self.runs else middle + half
        return lower, upper
