"""edges.npz: every edge of every pin and every accepted step, in counts of the board's timer since power-up."""

import zlib
from pathlib import Path
from typing import Any, Final
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from host.errors import InputError
from host.inputs import prefixed
from host.run_folder.layout import EDGES, FOLDER_VERSION, VERSION_KEY, ContradictionError, check_version, existing
from host.verify import COUNTS_PER_SECOND, AxisEvidence, Evidence, LevelEdges
from host.verify.evidence import Int8Array, Int64Array

PINS: Final = ("reset", "enable", "m1", "m2", "tq1", "tq2", "dcy1", "dcy2", "out1", "out2")
"""An axis' pins that are held at a level."""

_UNREADABLE: Final = (BadZipFile, EOFError, OSError, ValueError, zlib.error)
"""What numpy raises for a file that is none of its own, or is damaged."""


def write_edges(path: Path, evidence: Evidence) -> None:
    """Write the evidence; the outputs' names are the robot's business."""
    arrays: dict[str, Any] = {
        VERSION_KEY: np.int64(FOLDER_VERSION),
        "counts_per_second": np.int64(COUNTS_PER_SECOND),
        "start_counts": np.int64(evidence.start_counts),
        "axes": np.array([axis.name for axis in evidence.axes]),
    }
    for axis in evidence.axes:
        arrays |= {
            f"{axis.name}_start_steps": np.int64(axis.start_steps),
            f"{axis.name}_clk_rise_counts": axis.clk_rise_counts,
            f"{axis.name}_clk_fall_counts": axis.clk_fall_counts,
            f"{axis.name}_dir_edge_counts": axis.dir_edge_counts,
            f"{axis.name}_dir_levels": axis.dir_levels,
            f"{axis.name}_step_counts": axis.step_counts,
            f"{axis.name}_step_signs": axis.step_signs,
            f"{axis.name}_violations": np.int64(axis.violations),
        }
        for pin in PINS:
            arrays[f"{axis.name}_{pin}_counts"] = axis.pins[pin].counts
            arrays[f"{axis.name}_{pin}_levels"] = axis.pins[pin].levels
    np.savez_compressed(path, **arrays)


def read_edges(folder: Path) -> Evidence:
    """A folder's evidence, without the outputs' names.

    Raises:
        InputError: no such file, a key that is missing or of the wrong kind, another version.
        ContradictionError: arrays that do not go together.
    """
    path = existing(folder, EDGES)
    with prefixed(f"{path}: "):
        try:
            with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
                return _evidence(_Arrays(stored))
        except _UNREADABLE as error:
            raise InputError(f"cannot be read: {error}") from error


class _Arrays:
    """The file's arrays by key, each checked for kind and shape; what is wrong is said with the key in front."""

    def __init__(self, stored: Any) -> None:  # NpzFile, whose type numpy gives no name for its values
        self._stored = stored

    def integer(self, key: str) -> int:
        value = self._array(key)
        if value.ndim != 0 or value.dtype.kind != "i":
            raise InputError(f"{key}: is not one whole number")
        return int(value)

    def names(self, key: str) -> tuple[str, ...]:
        value = self._array(key)
        if value.ndim != 1 or value.dtype.kind != "U":
            raise InputError(f"{key}: is not a list of names")
        return tuple(value.tolist())

    def counts(self, key: str) -> Int64Array:
        """Instants: sorted, none before power-up."""
        values = self._integers(key).astype(np.int64, copy=False)
        if values.size and (values[0] < 0 or (np.diff(values) < 0).any()):
            raise ContradictionError(f"{key}: the instants are not in order of time")
        return values

    def signs(self, key: str, choices: tuple[int, int], like: str, length: int) -> Int8Array:
        """One of two numbers for each element of another array."""
        values = self._integers(key)
        if values.size != length:
            raise ContradictionError(f"{key}: {values.size} of them, but {length} {like}")
        if not np.isin(values, choices).all():
            raise ContradictionError(f"{key}: holds other numbers than {choices[0]} and {choices[1]}")
        return values.astype(np.int8, copy=False)

    def _integers(self, key: str) -> NDArray[Any]:
        values = self._array(key)
        if values.ndim != 1 or values.dtype.kind != "i":
            raise InputError(f"{key}: is not a list of whole numbers")
        return values

    def _array(self, key: str) -> NDArray[Any]:
        if key not in self._stored:
            raise InputError(f"{key}: is missing")
        with prefixed(f"{key}: "):
            try:
                return np.asarray(self._stored[key])
            except _UNREADABLE as error:
                raise InputError(f"cannot be read: {error}") from error


def _evidence(arrays: _Arrays) -> Evidence:
    check_version(arrays.integer(VERSION_KEY))
    counts_per_second = arrays.integer("counts_per_second")
    if counts_per_second != COUNTS_PER_SECOND:
        raise InputError(f"counts_per_second: {counts_per_second} is not {COUNTS_PER_SECOND}")
    return Evidence(arrays.integer("start_counts"), tuple(_axis(arrays, name) for name in arrays.names("axes")))


def _axis(arrays: _Arrays, name: str) -> AxisEvidence:
    rises, falls = _pulses(arrays, name)
    turns = arrays.counts(f"{name}_dir_edge_counts")
    steps = arrays.counts(f"{name}_step_counts")
    return AxisEvidence(
        name=name,
        start_steps=arrays.integer(f"{name}_start_steps"),
        clk_rise_counts=rises,
        clk_fall_counts=falls,
        dir_edge_counts=turns,
        dir_levels=arrays.signs(f"{name}_dir_levels", (0, 1), f"{name}_dir_edge_counts", turns.size),
        step_counts=steps,
        step_signs=arrays.signs(f"{name}_step_signs", (-1, 1), f"{name}_step_counts", steps.size),
        violations=arrays.integer(f"{name}_violations"),
        pins={pin: _pin(arrays, f"{name}_{pin}") for pin in PINS},
    )


def _pulses(arrays: _Arrays, name: str) -> tuple[Int64Array, Int64Array]:
    """Rises and falls, which must take turns."""
    rise_key, fall_key = f"{name}_clk_rise_counts", f"{name}_clk_fall_counts"
    rises, falls = arrays.counts(rise_key), arrays.counts(fall_key)
    if rises.size != falls.size:
        raise ContradictionError(f"{rise_key}: {rises.size} of them, but {falls.size} {fall_key}")
    if (falls <= rises).any() or (rises[1:] <= falls[:-1]).any():
        raise ContradictionError(f"{rise_key}: they do not take turns with {fall_key}")
    return rises, falls


def _pin(arrays: _Arrays, key: str) -> LevelEdges:
    counts = arrays.counts(f"{key}_counts")
    return LevelEdges(counts, arrays.signs(f"{key}_levels", (0, 1), f"{key}_counts", counts.size))
