"""Make one run of a campaign in this process, in virtual time, without files or pictures; always with the same row."""

import logging
import time
import traceback
from dataclasses import replace
from functools import cache

from steptwin.features.campaigns.campaign import Campaign
from steptwin.features.campaigns.invariants import asked_of, breaches_of
from steptwin.features.campaigns.margins import Claim, Performance, all_margins
from steptwin.features.campaigns.recovery import recover, steps_off
from steptwin.features.campaigns.row import Breach, Ended, Row, split_parameters
from steptwin.features.campaigns.trial import Trial, draw
from steptwin.features.faults.options import FaultOptions
from steptwin.features.faults.part import repair
from steptwin.features.motors.evidence import trace_of
from steptwin.features.motors.options import MotorOptions, MotorsTurn
from steptwin.features.motors.turning import MotorVerdict, motors_of_run
from steptwin.host.common.errors import BusError, DeviceFaultError, InputError
from steptwin.host.operate.session import Session
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.host.twin.embedded.execution import execute
from steptwin.host.twin.embedded.outcome import Outcome
from steptwin.host.twin.machine.drivers import driver_profile
from steptwin.host.twin.machine.kernels import Kernel, fastest_kernel
from steptwin.host.verify import Report, verify
from steptwin.protocol import od
from steptwin.protocol.cia402 import Status

_SIGNIFICANT_DIGITS = 6

# Silent nodes are expected in runs; these libraries' warnings would fill a worker's log.
for library in ("can", "canopen"):
    logging.getLogger(library).addHandler(logging.NullHandler())


def run_seed(campaign: Campaign, seed: int) -> Row:
    """Draw and make the run of a seed; errors go to its row."""
    try:
        trial = draw(campaign, seed)
    except InputError as error:
        return Row(seed, "", "", "", Ended.REFUSED, str(error))
    return run_trial(trial)


def run_trial(trial: Trial) -> Row:
    """Make a run; errors go to its row."""
    began_s = time.perf_counter()
    try:
        row = row_of(perform(trial))
    except InputError as error:
        row = _row(trial, Ended.REFUSED, str(error))
    except Exception as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        breach = Breach("program", f"{type(error).__name__} in {place.name}", f"{error} (line {place.lineno})")
        row = replace(_row(trial, Ended.CRASHED, str(error)), asked=(breach.invariant,), breaches=(breach,))
    return replace(row, wall_s=time.perf_counter() - began_s)


def _row(trial: Trial, ended: Ended, message: str) -> Row:
    """Return a row with the drawn values and the end of a run."""
    parameters, choices = split_parameters(trial.parameters)
    own = (trial.seed, trial.robot_name, trial.motion_name, trial.scenario)
    return Row(*own, ended, message, parameters=parameters, choices=choices)


def perform(trial: Trial) -> Performance:
    """Make a run; recover the machine and turn its motors if the campaign requires it.

    Raises:
        InputError: the robot, as drawn, cannot make the motion, or lacks the target of a fault.
    """
    plan = trial.plan()
    scenario = trial.scenario_in(plan)
    boards: list[EmbeddedBoard] = []
    outcome, message = None, ""
    try:
        outcome = execute(
            plan,
            trial.motion_name,
            _kernel(),
            driver_profile=trial.setup.driver_profile,
            extras=[FaultOptions(scenario=scenario), MotorOptions(motors=trial.motors is MotorsTurn.IN_LOOP)],
            axes_per_board=trial.setup.axes_per_board,
            crystal_ppm=trial.setup.crystals_ppm,
            on_board=boards.append,
        )
        message = outcome.fault.message if outcome.fault else ""
    except (DeviceFaultError, BusError) as error:
        message = str(error)
    (board,) = boards
    repair(board)  # another host, if the first one has died
    claims, own_time = _claims(board), _by_own_clocks(trial, board, outcome)
    recovery = recover(board) if trial.recover else None
    return Performance(
        trial=trial,
        ended=Ended.STOPPED if message else Ended.DONE,
        message=message,
        outcome=outcome,
        claims=claims,
        axes=board.axes_evidence(),
        recovery=recovery,
        own_time=own_time,
        motors=_motors(trial, outcome),
        simulated_s=board.now_s(),
    )


@cache
def _kernel() -> Kernel:
    return fastest_kernel()


def _claims(board: EmbeddedBoard) -> tuple[Claim, ...]:
    """Return every drive's reported position, read as an operator would; empty if one does not answer."""
    axes = Session(board, board.robot).machine.axes
    try:
        said = [(axis.read(od.STATUSWORD), axis.read(od.POSITION_ACTUAL)) for axis in axes]
    except (BusError, DeviceFaultError):
        return ()
    off = steps_off(board, [units for _, units in said])
    return tuple(
        Claim(axis.name, bool(statusword & Status.POSITION_KNOWN), steps, slipped)
        for axis, (statusword, _), steps, slipped in zip(axes, said, off, board.rotor_slips(), strict=True)
    )


def _motors(trial: Trial, outcome: Outcome | None) -> MotorVerdict | None:
    if trial.motors is None or outcome is None:
        return None
    setup = trial.setup
    profile = driver_profile(setup.robot.board, setup.driver_profile)
    trace = trace_of(outcome.comparison.evidence)
    return motors_of_run(setup.robot, outcome.comparison, profile, trace=trace).verdict


def _by_own_clocks(trial: Trial, board: EmbeddedBoard, outcome: Outcome | None) -> Report | None:
    """Verify a run by the boards' own time if their crystals are off; return None if all are exact."""
    if outcome is None or not any(trial.setup.crystals_ppm):
        return None
    return verify(outcome.comparison.expected, board.evidence_by_own_clocks(), outcome.report.run)


def row_of(run: Performance) -> Row:
    """Return the row of a run, without its computing time."""
    margins = {name: margin.of(run) for name, margin in all_margins().items()}
    return replace(
        _row(run.trial, run.ended, run.message),
        codes=_codes(run),
        faults=tuple(fault.name for fault in run.faults),
        struck=tuple(fault.strikes for fault in run.faults),
        met=tuple(sorted({fault.what for fault in run.faults if fault.struck})),
        asked=asked_of(run),
        breaches=breaches_of(run),
        margins={name: _short(margin) for name, margin in margins.items() if margin is not None},
        duration_s=0.0 if run.outcome is None else _short(run.outcome.report.run.duration_s),
        simulated_s=_short(run.simulated_s),
    )


def _codes(run: Performance) -> tuple[str, ...]:
    codes = {told.code for fault in run.faults for told in fault.emcys}
    if run.outcome is not None and run.outcome.fault is not None:
        codes |= {code for own in run.outcome.fault.codes.values() for code in own}
    return tuple(f"0x{code:04X}" for code in sorted(codes))


def _short(value: float) -> float:
    return float(f"{value:.{_SIGNIFICANT_DIGITS}g}")
