"""What `motors ROBOT` says: each joint's own motor, and those of the catalogue in its place."""

from typing import TYPE_CHECKING, Any

from steptwin.host.cli.arguments import finite_number
from steptwin.host.cli.option_names import naming_options
from steptwin.host.cli.output import print_json, print_table, say, warn

if TYPE_CHECKING:
    from steptwin.host.robots.robot import Robot
    from steptwin.host.twin.motors.fitting import Fit, JointFit
    from steptwin.host.twin.motors.ramps import Ramp


def tell_fits(robot: "Robot", current: str | None, *, as_json: bool) -> None:
    """Print how a robot's motors, and those of the catalogue, would do at the limits of its joints."""
    from steptwin.host.twin.motors import check_described
    from steptwin.host.twin.motors.driving import check_current
    from steptwin.host.twin.motors.fitting import fits_of
    from steptwin.host.twin.motors.verdict import MARGIN_MIN

    dynamics = check_described(robot)
    current_a = None if current is None else finite_number(current, "--current")
    if current_a is not None:
        with naming_options(current_a="--current"):
            check_current(current_a)
    fits = fits_of(robot, current_a)
    if as_json:
        head: dict[str, Any] = {"payload_kg": dynamics.payload_kg, "supply_v": dynamics.supply_v}
        print_json({"robot": robot.name, **head, "assumed": ["masses"], "joints": [fit.to_dict() for fit in fits]})
        return
    _print_own(fits)
    say("")
    _print_ramps(fits)
    say("")
    _print_pull_out(fits)
    say("")
    _print_others(fits)
    say(
        f"A motor of the catalogue would do where {100 * MARGIN_MIN:.0f} % is left; where not, the speed at which its"
        " torque is short follows",
    )
    for fit in fits:
        if not fit.own.would_do:
            warn(f"{fit.name}: {fit.own.motor}: {_shortage(fit.own)}")
    warn_of_steep_homings(fits)
    say(f"motors: with {dynamics.payload_kg:g} kg at the tool and {dynamics.supply_v:g} V ([A] masses)")


def _print_own(fits: "tuple[JointFit, ...]") -> None:
    heads = ["joint", "motor", "A", "needs Nm", "has Nm", "margin %", "at rpm", "top rpm", "inertia gcm2", "f0 Hz"]
    rows = [
        [
            fit.name,
            fit.own.motor,
            f"{fit.own.current_a:.2f}",
            f"{fit.own.torque_needed_nm:.3f}",
            f"{fit.own.torque_available_nm:.3f}",
            f"{100 * fit.own.margin:.0f}",
            f"{fit.own.rpm:.0f}",
            f"{fit.rpm_max:.0f}",
            f"{1e7 * fit.inertia_kgm2:.0f}",
            f"{fit.natural_hz:.1f}",
        ]
        for fit in fits
    ]
    print_table(heads, rows, text_columns=2)


def warn_of_steep_homings(fits: "tuple[JointFit, ...]") -> None:
    """Warn of each joint whose homing accelerates it harder than the motors manage."""
    from steptwin.host.twin.motors.steep_homings import steep_homing

    for fit in fits:
        if fit.homing is not None and fit.homing.too_steep:
            warn(steep_homing(fit.name, fit.unit, fit.homing))


def _print_ramps(fits: "tuple[JointFit, ...]") -> None:
    heads = ["joint", "unit", "acceleration_max", "motors manage", "homing", "motors manage"]
    rows = [
        [
            fit.name,
            f"{fit.unit}/s2",
            *_asked_and_managed(fit.moving, fit.name),
            *(("-", "-") if fit.homing is None else _asked_and_managed(fit.homing, fit.name)),
        ]
        for fit in fits
    ]
    print_table(heads, rows, text_columns=2)


def _asked_and_managed(ramp: "Ramp", name: str) -> tuple[str, str]:
    """Return both in words, with the joint whose motor manages no more if it is another one."""
    weakest = "" if ramp.weakest == name else f"{ramp.weakest}: "
    return f"{ramp.asked:g}", f"{weakest}{ramp.managed:.0f}"


def _print_pull_out(fits: "tuple[JointFit, ...]") -> None:
    from steptwin.host.twin.motors.fitting import TABLE_RPM

    heads = ["Nm at rpm", *(f"{rpm:g}" for rpm in TABLE_RPM)]
    print_table(heads, [[fit.name, *(f"{torque:.3f}" for torque in fit.pull_out_nm)] for fit in fits])


def _print_others(fits: "tuple[JointFit, ...]") -> None:
    heads = ["margin %", "A", *(fit.name for fit in fits)]
    rows = [
        [motor.motor, f"{motor.current_a:.2f}", *(_cell(fit.others[row]) for fit in fits)]
        for row, motor in enumerate(fits[0].others)
    ]
    print_table(heads, rows)


def _cell(fit: "Fit") -> str:
    """Return the margin; with the speed at which it is short if the motor would not do."""
    percent = f"{100 * fit.margin:.0f}" if fit.margin > -1.0 else "none"
    return percent if fit.would_do else f"{percent} at {fit.rpm:.0f}"


def _shortage(fit: "Fit") -> str:
    return f"needs {fit.torque_needed_nm:.3f} of {fit.torque_available_nm:.3f} Nm at {fit.rpm:.0f} turns a minute"
