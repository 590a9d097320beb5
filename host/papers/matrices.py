"""Show homogeneous transforms as the papers print them."""

from collections.abc import Sequence

from steptwin.host.common.arrays import FloatArray

COLUMNS = ("row", "n", "o", "a", "p mm")
"""The columns of a transform: the tool's axes and its position."""


def matrix_rows(names: Sequence[str], matrices: Sequence[FloatArray]) -> list[list[str]]:
    """Return a row of texts for each row of each 4 by 4 matrix but the last one, which is always 0 0 0 1."""
    return [
        [f"{name}, {axis}", *(f"{element:z.6f}" for element in row[:3]), f"{row[3]:z.3f}"]
        for name, matrix in zip(names, matrices, strict=True)
        for axis, row in zip("xyz", matrix[:3].tolist(), strict=True)
    ]
