"""The tables of motors, masses and supply in the file of a new robot."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from steptwin.host.common.bad_input import prefixed, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.common.numbers import finite_number
from steptwin.host.robots.joint import Unit
from steptwin.host.robots.motor import MOTORS
from steptwin.host.robots.toml_text import toml_lines

ASSUMED: Final = "ASSUMED"
"""Marks a figure of a new file that nobody has given."""
MOTOR: Final = "motor"
MASS: Final = "mass_kg"
SUPPLY: Final = "supply_v"

_USUAL_MOTOR: Final = MOTORS[1]
_FRICTION_NM: Final = 0.01
_MASS_KG: Final = 0.5
_SUPPLY_V: Final = 24.0
_ROD_MM: Final = 200.0
"""Length of the even rod for which the body of a joint that turns is taken."""
_HEAD: Final = """\
# Would the motors keep step? Write yours in these lines, without the first sign and the blank behind it; then
# `steptwin motors FILE` and `steptwin run FILE MOTION --motors` tell. docs/motors.md has the motors and every key.
#
"""
_HEAD_GIVEN: Final = """\
# Would the motors keep step? `steptwin motors FILE` and `steptwin run FILE MOTION --motors` tell. docs/motors.md has
# the motors and every key.
"""


def motor_model(text: str) -> str:
    """Return the model of a motor; raise InputError, with the nearest, for an unknown one."""
    if text not in MOTORS:
        raise unknown("model", text, MOTORS)
    return text


def mass_kg(text: str) -> float:
    """Return a mass; raise InputError for one below 0."""
    value = finite_number(text)
    if value < 0.0:
        raise InputError(f"{value:g} kg is below 0")
    return value


def supply_voltage(text: str) -> float:
    """Return a supply in V; raise InputError unless it is above 0."""
    value = finite_number(text)
    if not value > 0.0:
        raise InputError(f"{value:g} V is not above 0")
    return value


@dataclass(frozen=True, slots=True)
class NewMotors:
    """What the user says of the motors of a new robot.

    Attributes:
        models: models of `MOTORS`, by joint.
        masses_kg: masses that joints move, without what the next joints move, by joint.
        supply_v: supply of the drivers; None: not said.
    """

    models: Mapping[str, str] = field(default_factory=dict)
    masses_kg: Mapping[str, float] = field(default_factory=dict)
    supply_v: float | None = None

    @classmethod
    def of(cls, settings: Mapping[str, str]) -> "NewMotors":
        """Return what settings say by the keys `JOINT.motor`, `JOINT.mass_kg` and `supply_v`; skip other keys.

        Raises:
            InputError: an unknown model, or a mass or a supply that cannot be.
        """
        models, masses_kg, supply_v = dict[str, str](), dict[str, float](), None
        for key, text in settings.items():
            name, _, quantity = key.rpartition(".")
            with prefixed(f"{key}: "):
                if name and quantity == MOTOR:
                    models[name] = motor_model(text)
                elif name and quantity == MASS:
                    masses_kg[name] = mass_kg(text)
                elif key == SUPPLY:
                    supply_v = supply_voltage(text)
        return cls(models, masses_kg, supply_v)

    @property
    def is_given(self) -> bool:
        """True if anything is said."""
        return bool(self.models or self.masses_kg) or self.supply_v is not None

    def text(self, joints: Mapping[str, Unit]) -> str:
        """Return the tables of all joints and of the supply.

        With a motor, a mass or a supply given they are what `run --motors` needs, and the other figures are marked as
        assumed. With nothing given all lines are comments.
        """
        tables = self._tables(joints)
        if not self.is_given:
            return _HEAD + "".join(f"# {line}\n" for line in "".join(tables).splitlines())
        return _HEAD_GIVEN + "\n".join(tables)

    def assumptions(self, joints: Mapping[str, Unit]) -> list[str]:
        """Return a line for each kind of figure that is assumed; none if nothing is given."""
        if not self.is_given:
            return []
        lines = []
        if without := [name for name in joints if name not in self.models]:
            lines.append(f"motors of {', '.join(without)}: {self._assumed_model} is assumed; {_how(without, MOTOR)}")
        if without := [name for name in joints if name not in self.masses_kg]:
            lines.append(f"masses of {', '.join(without)}: {_MASS_KG:g} kg are assumed; {_how(without, MASS)}")
        if self.supply_v is None:
            lines.append(f"supply: {_SUPPLY_V:g} V are assumed; --set {SUPPLY}=V")
        return lines

    @property
    def _assumed_model(self) -> str:
        return next(iter(self.models.values()), _USUAL_MOTOR)

    def _tables(self, joints: Mapping[str, Unit]) -> list[str]:
        tables = []
        for name, unit in joints.items():
            model, mass = self.models.get(name), self.masses_kg.get(name)
            motor = {
                "model": (model or self._assumed_model, self._note("or the figures of its datasheet", model)),
                "friction_nm": (_FRICTION_NM, self._note("of motor and gear, at the motor's shaft")),
            }
            kg = _MASS_KG if mass is None else mass
            link: dict[str, tuple[Any, str]] = {
                MASS: (kg, self._note("of what the joint moves, without what the next joints move", mass))
            }
            if unit is Unit.DEG:
                across = float(f"{kg * (1e-3 * _ROD_MM) ** 2 / 12.0:.2g}")
                rod = self._note(f"its centre, from the joint's axis: a rod of {_ROD_MM:g} mm")
                link["centre_mm"] = ([_ROD_MM / 2.0, 0.0, 0.0], rod)
                link["inertia_kgm2"] = ([0.0, across, across], self._note("about its centre, likewise"))
            tables += [_table(f"joints.{name}.{MOTOR}", motor), _table(f"joints.{name}.link", link)]
        supply_v = _SUPPLY_V if self.supply_v is None else self.supply_v
        return [*tables, _table("dynamics", {SUPPLY: (supply_v, self._note("of the drivers", self.supply_v))})]

    def _note(self, what: str, given: object = None) -> str:
        return f"{ASSUMED}: {what}" if self.is_given and given is None else what


def _how(joints: Sequence[str], key: str) -> str:
    return f"--set {joints[0]}.{key}={'MODEL' if key == MOTOR else 'KG'}"


def _table(name: str, rows: Mapping[str, tuple[Any, str]]) -> str:
    values, notes = {key: value for key, (value, _) in rows.items()}, {key: note for key, (_, note) in rows.items()}
    return f"[{name}]\n{toml_lines(values, notes)}"
