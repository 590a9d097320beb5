"""Which drivers the emulated board has, and what they have to say, in the words of robots and of the verifier."""

import numpy as np
from numpy.typing import NDArray

from steptwin.emulator.driver_module import ClkEdge, Module
from steptwin.emulator.driver_profiles import PROFILES, DriverProfile, bare_chip
from steptwin.emulator.edges import NO_COUNTS, NO_LEVELS, Int64Array
from steptwin.emulator.tb6560 import Outputs, Unit, Violations
from steptwin.host.common.bad_input import unknown
from steptwin.host.common.errors import InputError
from steptwin.host.robots.board_settings import DRIVER_SETTINGS, BoardSettings
from steptwin.host.verify import DriverLimit, DriverViolations, Phases
from steptwin.protocol.timer import COUNTS_PER_US

_SCALES = {Unit.COUNTS: ("us", 1 / COUNTS_PER_US), Unit.LEVEL: ("level", 1), Unit.CELSIUS: ("degC", 1)}
"""How values are told, and by what they are multiplied for it."""


def driver_profile(board: BoardSettings, instead: str | None = None) -> DriverProfile:
    """The drivers that a robot's file names, or others instead.

    Raises:
        InputError: there are none of this name.
    """
    name = board.driver_profile if instead is None else instead
    if name is None:
        assert board.osc_pf is not None
        return bare_chip(board.osc_pf)
    if name not in PROFILES:
        raise unknown("driver profile", name, PROFILES)
    return PROFILES[name]


def fitted_module(board: BoardSettings, profile: DriverProfile, microsteps: int) -> Module:
    """The module of an axis, set as the robot's file says where these are its own drivers, else as usual with them.

    Raises:
        InputError: the module cannot be set so.
    """
    if profile != driver_profile(board):
        return profile.fitted(microsteps)
    edge = board.active_edge
    try:
        return profile.fitted(
            microsteps,
            board.current_a,
            ClkEdge(edge) if edge else None,
            idle_percent=board.idle_percent,
            fast_decay_percent=board.fast_decay_percent,
        )
    except ValueError as error:
        raise InputError(f"board.current_a: {error}") from error


def settings_left_out(board: BoardSettings, instead: str | None) -> tuple[str, ...]:
    """The keys by which a robot's file sets its drivers, if it has others instead, which they say nothing about.

    Raises:
        InputError: there are none of this name.
    """
    if driver_profile(board, instead) == driver_profile(board):
        return ()
    return tuple(key for key in DRIVER_SETTINGS if getattr(board, key) is not None)


def violations_evidence(violations: Violations) -> DriverViolations:
    """Counts become microseconds; all else stays."""
    scales = np.array([_SCALES[limit.unit][1] for limit in violations.limits])
    limits = tuple(
        DriverLimit(
            limit.rule.name.lower(), limit.rule.value, limit.value * scale, _SCALES[limit.unit][0], limit.source
        )
        for limit, scale in zip(violations.limits, scales.tolist(), strict=True)
    )
    values = violations.values * scales[violations.which]
    return DriverViolations(limits, violations.counts, violations.which, values)


def phases_evidence(outputs: Outputs) -> Phases:
    """Sampled wherever something may change; instants at which nothing does are left out, but for the very first."""
    counts = outputs.instants()
    if not counts.size:
        return Phases(NO_COUNTS, NO_LEVELS, np.empty(0, np.int16), np.empty(0, np.int16))
    values, before = _phase_values(outputs, counts), _phase_values(outputs, counts[:1] - 1)
    changed = (values != np.concatenate((before, values[:-1]))).any(axis=1)
    changed[:1] |= outputs.from_counts == 0
    angle, a_ma, b_ma = values[changed].T
    return Phases(counts[changed], angle.astype(np.int8), a_ma.astype(np.int16), b_ma.astype(np.int16))


def _phase_values(outputs: Outputs, counts: Int64Array) -> NDArray[np.int64]:
    """Shape (n, 3): angle in sixteenths and both currents in mA."""
    currents_ma = np.rint(1000 * outputs.currents_a(counts)).astype(np.int64)
    return np.column_stack([outputs.sixteenths(counts), currents_ma])
