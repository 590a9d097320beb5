"""Run the rotors' functions as plain Python on lists, or compiled by numba on arrays. Both give the same bytes."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any, cast

from steptwin.controller.motion.backend import inline_kernel_functions
from steptwin.controller.motion.kernel import Function
from steptwin.emulator.board.edges import FloatArray
from steptwin.emulator.drivers import power_supply
from steptwin.features.motors.rotors import following, mechanics, rotor_kernel, rotor_run
from steptwin.features.motors.rotors.arm import Arm
from steptwin.features.motors.rotors.following import ArmArrays, JointArrays
from steptwin.features.motors.rotors.mechanics import MassArrays, MotionArrays, needed_by
from steptwin.features.motors.rotors.rotor_kernel import EventArrays, RotorArrays
from steptwin.features.motors.rotors.rotor_run import run_rotors

Numbers = Any
"""A list of floats, or a float64 array."""
Indices = Any
"""A list of integers, or an int64 array."""


@dataclass(frozen=True, slots=True)
class RotorBackend:
    """Functions and the storage that they run on.

    Attributes:
        name: "python" or "numba".
        numbers: makes storage that holds these floats.
        indices: makes storage that holds these integers.
        rows: makes storage that holds a table of floats, row by row.
    """

    name: str
    numbers: Callable[[Sequence[float]], Numbers]
    indices: Callable[[Sequence[int]], Indices]
    rows: Callable[[FloatArray], Numbers]
    run: Callable[..., None]
    need: Callable[..., None]


def python_rotors() -> RotorBackend:
    """Return the reference: the functions on lists."""
    return RotorBackend(
        name="python",
        numbers=lambda values: [float(value) for value in values],
        indices=lambda values: [int(value) for value in values],
        rows=lambda table: table.ravel().tolist(),
        run=run_rotors,
        need=needed_by,
    )


@cache
def compiled_rotors() -> RotorBackend:
    """Return the same functions compiled; raise ModuleNotFoundError without the extra `fast`."""
    import numba
    import numpy as np

    inline_kernel_functions()
    number, integer, numbers, indices = numba.float64, numba.int64, numba.float64[::1], numba.int64[::1]

    def record(kind: type, *fields: Any) -> Any:
        return numba.types.NamedTuple(fields, kind)  # type: ignore[no-untyped-call]

    arm = record(ArmArrays, *4 * (numbers,), *2 * (integer,), number)
    joints = record(JointArrays, *4 * (numbers,))

    def compiled(function: Function, *arguments: Any) -> Function:
        dispatcher = numba.njit(cache=True, error_model="numpy")(function)
        if dispatcher.stats.cache_path is not None:
            _drop_stale(Path(dispatcher.stats.cache_path))
        dispatcher.compile(arguments)
        return cast("Function", dispatcher.get_overload(arguments))

    return RotorBackend(
        name="numba",
        numbers=lambda values: np.array(values, dtype=np.float64),
        indices=lambda values: np.array(values, dtype=np.int64),
        rows=lambda table: table.ravel(),
        run=compiled(
            run_rotors,
            arm,
            joints,
            record(MassArrays, *5 * (numbers,)),
            record(RotorArrays, *6 * (numbers,)),
            record(EventArrays, numbers, *2 * (indices,)),
            numbers,
            *2 * (integer,),
            number,
        ),
        need=compiled(needed_by, arm, joints, *3 * (numbers,), record(MotionArrays, *4 * (numbers,))),
    )


def _drop_stale(cache: Path) -> None:
    """Delete compiled functions older than a source file; numba checks only the function's own file."""
    sources = (rotor_run, rotor_kernel, mechanics, following, power_supply)
    changed_s = max(Path(str(module.__file__)).stat().st_mtime for module in sources)
    for stem in ("rotor_run", "mechanics"):
        for index in cache.glob(f"{stem}.*.nbi"):
            with suppress(OSError):  # another process has deleted it, or it belongs to another user
                if index.stat().st_mtime < changed_s:
                    index.unlink()


def fastest_rotors() -> RotorBackend:
    """Return the compiled functions if numba is installed, else the plain ones."""
    return compiled_rotors() if find_spec("numba") else python_rotors()


def arm_arrays(arm: Arm, backend: RotorBackend, gravity_m_s2: float) -> ArmArrays:
    """Return a mechanism in the storage of a backend."""
    return ArmArrays(
        bodies=body_numbers(arm, backend),
        slopes=backend.numbers(arm.slopes.ravel().tolist()),
        offsets=backend.numbers(arm.offsets.tolist()),
        pair=backend.numbers(arm.pair_numbers),
        body_count=len(arm.bodies),
        axis_count=arm.slopes.shape[1],
        gravity_m_s2=gravity_m_s2,
    )


def body_numbers(arm: Arm, backend: RotorBackend) -> Numbers:
    """Return the numbers of the bodies alone."""
    return backend.numbers([value for body in arm.bodies for value in body.numbers()])


def joint_arrays(arm: Arm, backend: RotorBackend) -> JointArrays:
    """Return the storage of the mechanism's joints, filled with 0."""
    count = len(arm.bodies)
    lengths = (count, count, count, count * mechanics.MOTION_FIELDS)
    return JointArrays(*(backend.numbers([0.0] * length) for length in lengths))
