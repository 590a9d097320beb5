"""Write the robot file of a controller's configuration: each number with its origin, what is assumed marked."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

from steptwin.features.makers.configurations.machine import AxisFound, Configuration, Figure
from steptwin.host.common.bad_input import at_most, prefixed, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.common.numbers import finite_number
from steptwin.host.robots import read_robot
from steptwin.host.robots.joint import Unit
from steptwin.host.robots.new_file import DRIVER_PROFILE, NewRobot
from steptwin.host.robots.new_joint import FULL_STEPS_PER_REV, board_of, board_with
from steptwin.host.robots.new_motors import ASSUMED, MASS, MOTOR, SUPPLY, NewMotors
from steptwin.host.robots.toml_text import toml_lines

KIND: Final = "cartesian"
ROTARY: Final = "C"
_DRIVERS: Final = ("a4988", "drv8825", "tmc2209")
"""Drivers that are assumed where a file names none: the first that makes all microsteps."""
_MICROSTEPS: Final = 16
_SKEW_MM: Final = 2.0
_BEYOND_MM: Final = 1.0
"""Distance of a switch beyond the range, since here no switch is closed within it."""
_SLOWER: Final = 5.0
"""Highest speed over the speed of the search for a switch, and this over the speed across its edge."""
_BELTS: Final = "belts"
_AXES: Final = "axes"
_COREXY: Final = "corexy"
_NEEDED: Final = {
    "lower": "least position in {}",
    "upper": "greatest position in {}",
    "speed_max": "highest speed in {}/s",
    "acceleration_max": "highest acceleration in {}/s2",
}
"""Figures that each axis must have, with their meanings."""
_OF_AXES: Final = (*_NEEDED, "microsteps", "full_steps_per_rev")
"""Figures of an axis that a setting of the same name replaces."""
_COUPLING: Final = """\
[coupling] # rows are axes (motors with their belts), columns joints: both belts move both slides (docs/robot-files.md)
X = { X = 1.0, Y = 1.0 }
Y = { X = -1.0, Y = 1.0 } # turned round where the controller has X - Y: each motor alone moves its slide forward
"""


def robot_of(name: str, configuration: Configuration, settings: Mapping[str, str], source: str) -> NewRobot:
    """Return the robot file of a configuration.

    Args:
        name: name of the robot.
        configuration: what the controller's file says.
        settings: values as texts, which go before the file's: `axes`, `belts`, `driver_profile`, and of an axis
            `X.lower`, `X.upper`, `X.speed_max`, `X.acceleration_max`, `X.microsteps`, `X.full_steps_per_rev`,
            `X.travel_per_turn` or `X.ratio`, `X.motor`, `X.mass_kg`; and `supply_v`.
        source: name of the controller's file, for the comments.

    Raises:
        InputError: the configuration and the settings leave open what a robot needs, or it would be no robot.
    """
    axes = _axes(configuration, settings)
    corexy = _is_corexy(configuration, settings)
    if missing := list(missing_figures(configuration, settings)):
        given = " ".join(f"--set {each}=..." for each in missing)
        raise InputError(f"{configuration.controller} says nothing of {', '.join(missing)}: add {given}")
    drivers, of_drivers, fill_in = _drivers(axes, settings)
    transmissions = {}
    for axis in axes:
        transmissions[axis.name], assumed = _transmission(axis, settings, drivers)
        fill_in += assumed
    notes = [*configuration.notes]
    pulses, told = _pulses(configuration, drivers)
    notes += told
    board = replace(board_of(drivers), **{key: value for key, (value, _) in pulses.items()})
    axes, told = _within_rate(axes, board.driver_rate_max_hz)
    notes += told
    notes += _moved_switches(axes)
    if configuration.left_out:
        notes.append(f"not read: {', '.join(configuration.left_out)}")
    with prefixed("--set "):
        said = NewMotors.of(settings)
    letters = {axis.name: _letter(axis) for axis in axes}
    motors = replace(
        said,
        models={letters[name]: model for name, model in said.models.items()},
        masses_kg={letters[name]: mass_kg for name, mass_kg in said.masses_kg.items()},
    )
    units = {_letter(axis): axis.unit for axis in axes}
    notes += [f"fill in: {each}" for each in (*fill_in, *motors.assumptions(units))]
    text = "\n".join(
        [
            _HEAD.format(controller=configuration.controller, source=source, assumed=ASSUMED),
            toml_lines({"name": name, "title": f"{name}, made of a configuration of {configuration.controller}"}, {}),
            f'[kinematics]\nkind = "{KIND}"\naxes = "{"".join(_letter(axis) for axis in axes)}"\n',
            *([_COUPLING] if corexy else []),
            "[board]\n" + _lines({DRIVER_PROFILE: (drivers, of_drivers), **pulses, **_current(axes, drivers)}),
            *(_joint_text(axis, transmissions[axis.name], coupled=corexy and axis.name in "XY") for axis in axes),
            "[home] # where the machine is taken after homing\n"
            + _lines({_letter(axis): _home(axis) for axis in axes}),
            motors.text(units),
        ]
    )
    read_robot(text)
    joints = tuple(_letter(axis) for axis in axes)
    return NewRobot(text, KIND, {"axes": "".join(joints)}, joints, tuple(notes))


def missing_figures(configuration: Configuration, settings: Mapping[str, str]) -> dict[str, str]:
    """Return the meaning of each figure that a robot needs and nobody has given, by its key, such as `X.upper`.

    Raises:
        InputError: a setting is unknown or no value.
    """
    return {
        f"{axis.name}.{key}": what.format(axis.unit)
        for axis in _axes(configuration, settings)
        for key, what in _NEEDED.items()
        if getattr(axis, key) is None
    }


def _axes(configuration: Configuration, settings: Mapping[str, str]) -> tuple[AxisFound, ...]:
    axes = _chosen(configuration.axes, settings.get(_AXES))
    _check_settings(settings, axes)
    return tuple(_with_settings(axis, settings) for axis in axes)


_HEAD: Final = """\
# A machine with {controller}, made of {source}. Behind each number stands where it comes from; what the file
# does not say is marked {assumed}. `steptwin check` reads this file. Lengths are in mm, angles in degrees.
"""


def _letter(axis: AxisFound) -> str:
    return axis.name if axis.unit is Unit.MM else ROTARY


def _chosen(axes: Sequence[AxisFound], letters: str | None) -> tuple[AxisFound, ...]:
    """Return the axes that the machine has here: X, Y, Z and one that turns, or those of the setting."""
    by_name = {axis.name: axis for axis in axes}
    if letters is None:
        turning = [axis for axis in axes if axis.unit is Unit.DEG]
        return tuple(axis for axis in axes if axis.name in "XYZ" or axis in turning[:1])
    for letter in letters:
        if letter not in by_name:
            raise unknown("--set axes: axis", letter, by_name)
    return tuple(by_name[letter] for letter in dict.fromkeys(letters))


def _check_settings(settings: Mapping[str, str], axes: Sequence[AxisFound]) -> None:
    names = {axis.name for axis in axes}
    known = [_AXES, _BELTS, DRIVER_PROFILE, SUPPLY]
    for axis in axes:
        turn = "travel_per_turn" if axis.unit is Unit.MM else "ratio"
        known += [f"{axis.name}.{key}" for key in (*_OF_AXES, turn, MOTOR, MASS)]
    for key in settings:
        if key not in known:
            name = key.partition(".")[0]
            raise unknown("--set", key, known if name in names or "." not in key else sorted(names))


def _is_corexy(configuration: Configuration, settings: Mapping[str, str]) -> bool:
    belts = settings.get(_BELTS)
    if belts is None:
        return bool(configuration.corexy)
    if belts not in ("each", _COREXY):
        raise unknown("--set belts:", belts, ("each", _COREXY))
    return belts == _COREXY


def _with_settings(axis: AxisFound, settings: Mapping[str, str]) -> AxisFound:
    changes: dict[str, Any] = {}
    for key in _OF_AXES:
        text = settings.get(f"{axis.name}.{key}")
        if text is not None:
            with prefixed(f"--set {axis.name}.{key}: "):
                changes[key] = Figure(finite_number(text), f"--set {axis.name}.{key}={text}")
    return replace(axis, **changes)


def _drivers(axes: Sequence[AxisFound], settings: Mapping[str, str]) -> tuple[str, str, list[str]]:
    """Return the drivers' profile, its origin, and what is to be filled in."""
    if DRIVER_PROFILE in settings:
        name = settings[DRIVER_PROFILE]
        with prefixed(f"--set {DRIVER_PROFILE}: "):
            board_with(name)
        return name, f"--set {DRIVER_PROFILE}={name}", []
    found = [axis.drivers for axis in axes if axis.drivers is not None]
    if not found:
        wanted = {axis.microsteps.value for axis in axes if axis.microsteps is not None}
        made = {name: set(board_of(name).profile.chip.microsteps) for name in _DRIVERS}
        assumed = next((name for name in _DRIVERS if wanted <= made[name]), _DRIVERS[-1])
        return assumed, ASSUMED, [f"{DRIVER_PROFILE}: {assumed} is assumed; --set {DRIVER_PROFILE}=NAME"]
    names = dict.fromkeys(each.profile for each in found)
    others = [name for name in names if name != found[0].profile]
    several = f"{DRIVER_PROFILE}: a board here has drivers of one kind, and {', '.join(others)} is another"
    return found[0].profile, found[0].origin, [several] if others else []


def _transmission(axis: AxisFound, settings: Mapping[str, str], drivers: str) -> tuple[dict[str, Any], list[str]]:
    """Return the keys of a joint's transmission with their origins, and what is to be filled in.

    Microsteps times full steps over the travel per turn are the controller's steps per unit, to the last digit.
    """
    key = "travel_per_turn" if axis.unit is Unit.MM else "ratio"
    full = axis.full_steps_per_rev or Figure(FULL_STEPS_PER_REV, f"{ASSUMED}: a motor of 1.8 deg", assumed=True)
    steps = axis.steps_per_unit
    text = settings.get(f"{axis.name}.{key}")
    fill_in = []
    microsteps = axis.microsteps
    if text is not None:
        with prefixed(f"--set {axis.name}.{key}: "):
            turn = finite_number(text)
            if not turn > 0:
                raise InputError(f"{turn:g} is not above 0")
        per_turn = turn if axis.unit is Unit.MM else 360.0 / turn
        made = steps.value * per_turn / full.value
        if abs(made - round(made)) > 1e-6 * made or not round(made):
            raise InputError(
                f"--set {axis.name}.{key}={text}: {steps.value:g} steps per {axis.unit} ({steps.origin}) would be"
                f" {made:g} microsteps, no whole number"
            )
        microsteps = Figure(round(made), f"{steps.origin}, and {key}")
        origin = f"--set {axis.name}.{key}={text}"
    else:
        if microsteps is None:
            microsteps = Figure(_nearest_made(drivers), f"{ASSUMED}, as the driver is set")
            fill_in.append(
                f"{axis.name}: {steps.value:g} steps per {axis.unit} are sure, {microsteps.value:g} microsteps are"
                f" assumed: --set {axis.name}.microsteps=N or --set {axis.name}.{key}=..."
            )
        per_turn = full.value * microsteps.value / steps.value
        turn = per_turn if axis.unit is Unit.MM else 360.0 / per_turn
        origin = f"for {steps.value:g} steps per {axis.unit}: {steps.origin}"
    return {
        "full_steps_per_rev": (int(full.value), full.origin),
        "microsteps": (int(microsteps.value), microsteps.origin),
        key: (turn, origin),
    }, fill_in


def _nearest_made(drivers: str) -> int:
    made = board_of(drivers).profile.chip.microsteps
    return max((each for each in made if each <= _MICROSTEPS), default=made[0])


def _pulses(configuration: Configuration, drivers: str) -> tuple[dict[str, Any], list[str]]:
    """Return the controller's times that the drivers bear, and a line for each that they do not."""
    board = board_of(drivers)
    least = {key: getattr(board, key) for key in ("steplen_ns", "stepspace_ns", "dirsetup_ns", "dirhold_ns")}
    chip = board.profile.chip.times
    kept, told = dict[str, Any](), list[str]()
    for key, figure in configuration.pulses_ns.items():
        needed_ns = max(chip.ns(key), board.profile.times.ns(key))
        if figure.value < needed_ns:
            told.append(
                f"{key}: {drivers} needs {needed_ns} ns, the controller makes {figure.value:g} ns ({figure.origin}):"
                " the machine may lose steps; the file has what the driver needs"
            )
        elif figure.value > least[key]:
            kept[key] = (round(figure.value), figure.origin)
    if "steplen_ns" in kept or "stepspace_ns" in kept:
        both = [kept[key][0] if key in kept else least[key] for key in ("steplen_ns", "stepspace_ns")]
        rate = min(board.step_rate_max_hz, 10**9 // sum(both))
        kept["step_rate_max_hz"] = (rate, "what these pulses allow")
    return kept, told


def _within_rate(axes: Sequence[AxisFound], rate_max_hz: float) -> tuple[tuple[AxisFound, ...], list[str]]:
    """Return the axes no faster than the pulses allow, and a line for each that is slower than its file says."""
    kept, told = list[AxisFound](), list[str]()
    for axis in axes:
        assert axis.speed_max is not None
        most = float(at_most(rate_max_hz / axis.steps_per_unit.value * (1 - 1e-9)))
        if axis.speed_max.value <= most:
            kept.append(axis)
            continue
        told.append(
            f"{axis.name}: {axis.speed_max.value:g} {axis.unit}/s ({axis.speed_max.origin}) is more than the {most:g}"
            f" that {rate_max_hz:.0f} steps/s of driver and pulses allow; the file has these"
        )
        kept.append(replace(axis, speed_max=Figure(most, f"{axis.speed_max.origin}, as far as the pulses allow")))
    return tuple(kept), told


def _current(axes: Sequence[AxisFound], drivers: str) -> dict[str, Any]:
    """Return the drivers' current: the least of the axes', since a board here has one."""
    found = [axis.current_a for axis in axes if axis.current_a is not None]
    if not found:
        return {}
    least = min(found, key=lambda each: each.value)
    try:
        board_of(drivers).profile.current(least.value)
    except ValueError:
        return {}
    return {"current_a": (round(least.value, 3), least.origin)}


def _home(axis: AxisFound) -> tuple[float, str]:
    assert axis.lower is not None
    assert axis.upper is not None
    place = axis.endstop.value if axis.endstop is not None else 0.0
    return min(max(place, axis.lower.value), axis.upper.value), "the switch" if axis.endstop is not None else ASSUMED


def _joint_text(axis: AxisFound, transmission: Mapping[str, Any], *, coupled: bool) -> str:
    assert axis.speed_max is not None
    assert axis.acceleration_max is not None
    motors = {"axis_speed_max": axis.speed_max, "axis_acceleration_max": axis.acceleration_max} if coupled else {}
    figures: dict[str, Any] = {"unit": (axis.unit.value, "")}
    for key in _NEEDED:
        figures[key] = getattr(axis, key)
    if axis.jerk_max is not None:
        figures["jerk_max"] = axis.jerk_max
    for key, figure in motors.items():
        figures[key] = figure._replace(origin=f"{ASSUMED}: as the slide's; along a diagonal a motor turns faster")
    parts = [f"[joints.{_letter(axis)}]\n" + _lines({**figures, **transmission})]
    if axis.second_motor:
        second = {
            "name": (f"{axis.name}2", axis.second_motor),
            "skew_max": (_SKEW_MM, f"{ASSUMED}: the ends may differ"),
        }
        parts.append(f"[joints.{_letter(axis)}.second_motor]\n" + _lines(second))
    parts += _homing(axis)
    return "\n".join(parts)


def _homing(axis: AxisFound) -> Iterator[str]:
    """Yield the tables of the switch and of the search for it."""
    assert axis.acceleration_max is not None
    assert axis.lower is not None
    assert axis.upper is not None
    assert axis.speed_max is not None
    name = _letter(axis)
    search = axis.search_speed or Figure(axis.speed_max.value / _SLOWER, ASSUMED)
    search = min(search, axis.speed_max, key=lambda each: each.value)
    zero = axis.zero_speed or Figure(search.value / _SLOWER, ASSUMED)
    speeds = {
        "search_speed": search,
        "zero_speed": min(zero, search, key=lambda each: each.value),
        "acceleration": (axis.acceleration_max.value, "acceleration_max"),
    }
    if not axis.home_direction:
        here = (35, "without a switch: zero is where the axis stands")
        yield f"[joints.{name}.homing]\n" + _lines({"method": here, **speeds})
        return
    key, end, method = (
        ("negative_limit", axis.lower, 17) if axis.home_direction < 0 else ("positive_limit", axis.upper, 18)
    )
    told = "" if axis.endstop is None else f"{axis.endstop.value:g}: {axis.endstop.origin}; "
    beyond = end.value + axis.home_direction * _BEYOND_MM
    note = f"{told}{ASSUMED}: {_BEYOND_MM:g} beyond the range, within which no switch is closed here"
    yield f"[joints.{name}.switches]\n" + _lines({key: (beyond, note)})
    yield f"[joints.{name}.homing]\n" + _lines({"method": (method, "towards the switch, then away from it"), **speeds})


def _moved_switches(axes: Sequence[AxisFound]) -> Iterator[str]:
    """Yield a line for each switch that lies within the range of its axis, where here none is closed."""
    for axis in axes:
        end = axis.lower if axis.home_direction < 0 else axis.upper
        if axis.endstop is None or end is None:
            continue
        inside = axis.home_direction * (end.value - axis.endstop.value)
        if inside > _BEYOND_MM:
            yield (
                f"{axis.name}: the switch at {axis.endstop.value:g} ({axis.endstop.origin}) is {inside:g} {axis.unit}"
                " within the range, where no switch is closed here: the file has it behind the end"
            )


def _lines(figures: Mapping[str, Any]) -> str:
    """Return a line for each figure, with its origin as a comment."""
    values = {key: figure[0] for key, figure in figures.items()}
    notes = {}
    for key, figure in figures.items():
        origin = " ".join(str(figure[1]).split())
        assumed = isinstance(figure, Figure) and figure.assumed and not origin.startswith(ASSUMED)
        if origin:
            notes[key] = f"{ASSUMED}: {origin}" if assumed else origin
    return toml_lines(values, notes)
