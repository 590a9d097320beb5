"""The drive of a joint and its load: motor, gear, brake and mass, for the model of motors and mechanics.

The kinematics and the board need none of it. Torques are those at the motor's shaft.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Final

from steptwin.host.common.errors import InputError
from steptwin.host.common.file_models import FileTable
from steptwin.host.common.file_values import Choice, NotNegative, Positive, Values, Within, check_limits
from steptwin.host.common.findings import check_all

MOTORS: Final = (
    "17HE19-2004S",
    "17HS19-2004S1",
    "23HS22-2804S",
    "23HS30-2804S",
    "17HS08-1004S",
    "17HS13-0404S",
    "17HS16-2004S1",
    "17HS19-1684S1",
    "17HS24-2104S",
    "MS17HD6P4200",
    "MS17HDBP4200",
    "QSH5718-41",
    "QSH5718-55",
    "QSH5718-79",
)
"""Motors of the catalogue, which a robot's file may name."""

FIGURES: Final = (
    "resistance_ohm",
    "inductance_mh",
    "holding_torque_nm",
    "rated_current_a",
    "rotor_inertia_gcm2",
    "detent_torque_nm",
)
"""Figures of a motor's datasheet, which a file gives instead of a name."""

Triple = Annotated[tuple[float, float, float], Values("a point has three: [x, y, z]")]


@dataclass(frozen=True, slots=True)
class JointMotor(FileTable):
    """The motor of a joint's axis: a name of the catalogue, or all figures of its datasheet; and its gear.

    Attributes:
        model: name in the catalogue.
        resistance_ohm: of one phase; likewise the other figures, as in the datasheet.
        friction_nm: Coulomb friction of motor and gear.
        efficiency: of the gear, above 0 and up to 1.
        brake_nm: torque of a brake that holds while the driver's outputs are off.
        belt_nm_rad: stiffness of a belt or shaft between motor and joint; None: stiff.
        belt_damping_nm_s: its damping.

    Raises:
        InputError: both a name and figures, or neither; an unknown name; a figure that is missing or out of range.
    """

    model: Annotated[str, Choice("", MOTORS)] = ""
    resistance_ohm: Positive | None = None
    inductance_mh: Positive | None = None
    holding_torque_nm: Positive | None = None
    rated_current_a: Positive | None = None
    rotor_inertia_gcm2: Positive | None = None
    detent_torque_nm: NotNegative | None = None
    friction_nm: NotNegative = 0.01
    efficiency: Annotated[float, Within(0.0, 1.0, open=True)] = 1.0
    brake_nm: NotNegative = 0.0
    belt_nm_rad: Positive | None = None
    belt_damping_nm_s: NotNegative = 0.0

    def __post_init__(self) -> None:
        check_all(self._check_motor, partial(check_limits, self))

    def _check_motor(self) -> None:
        given = [key for key in FIGURES if getattr(self, key) is not None]
        if self.model:
            if given:
                raise InputError(f"{given[0]}: model {self.model} sets it already")
            return
        missing = [key for key in FIGURES if key not in given]
        if missing:
            raise InputError(f"{missing[0]}: is missing; a motor needs it or model, one of {', '.join(MOTORS)}")


@dataclass(frozen=True, slots=True)
class JointLink(FileTable):
    """The body that a joint moves, without what the next joints move.

    Its frame has its origin on the joint's axis and its z along the axis; x points to the next joint.

    Attributes:
        mass_kg: its mass.
        centre_mm: its centre of mass.
        inertia_kgm2: about axes through the centre, parallel to x, y and z.
        stop_lower: position of the joint, in its unit, at its lower end stop; None: it has none.
        stop_upper: likewise at the upper one.

    Raises:
        InputError: a negative figure, or inertias that no body has: each is at most the sum of the other two.
    """

    mass_kg: Annotated[float, Within(0.0, unit="kg")]
    centre_mm: Triple = (0.0, 0.0, 0.0)
    inertia_kgm2: Triple = (0.0, 0.0, 0.0)
    stop_lower: float | None = None
    stop_upper: float | None = None

    def __post_init__(self) -> None:
        check_all(partial(check_limits, self), self._check_inertia)

    def _check_inertia(self) -> None:
        for index, value in enumerate(self.inertia_kgm2):
            others = sum(self.inertia_kgm2) - value
            if not value >= 0.0:
                raise InputError(f"inertia_kgm2[{index}]: {value:g} is negative")
            if value > others * (1.0 + 1e-9):
                raise InputError(
                    f"inertia_kgm2[{index}]: {value:g} is more than the sum of the other two, {others:g}:"
                    " no body has such inertias"
                )

    def check_stops(self, used: Mapping[str, float | None], unit: str) -> None:
        """Raise InputError unless all that the joint uses lies between its end stops: positions by their keys."""
        places = {key: at for key, at in used.items() if at is not None}
        lowest, highest = min(places, key=places.__getitem__), max(places, key=places.__getitem__)
        check_all(
            partial(self._check_stop, "stop_lower", "below", lowest, places[lowest], unit),
            partial(self._check_stop, "stop_upper", "above", highest, places[highest], unit),
        )

    def _check_stop(self, key: str, side: str, nearest: str, limit: float, unit: str) -> None:
        stop = getattr(self, key)
        if stop is not None and not (stop < limit if side == "below" else stop > limit):
            raise InputError(f"{key}: {stop:g} {unit} is not {side} {nearest}, {limit:g} {unit}")


@dataclass(frozen=True, slots=True)
class Dynamics(FileTable):
    """Settings that all motors share.

    Attributes:
        supply_v: supply of the drivers, without load.
        supply_ohm: resistance of the supply and its wires, by which it sags; 0: it does not.
        supply_uf: capacitors at the drivers, in microfarad, which hold what braking motors give back.
        payload_kg: mass at the tool's tip.
        payload_held_by: output while which is on the payload hangs at the tool; empty: always.

    Raises:
        InputError: no supply, one that sags without capacitors, or a negative figure.
    """

    supply_v: Positive
    supply_ohm: Annotated[float, Within(0.0, unit="ohm")] = 0.0
    supply_uf: Annotated[float, Within(0.0, unit="uF")] = 0.0
    payload_kg: Annotated[float, Within(0.0, unit="kg")] = 0.0
    payload_held_by: str = ""

    def __post_init__(self) -> None:
        check_all(partial(check_limits, self), self._check_sag)

    def _check_sag(self) -> None:
        if self.supply_ohm > 0.0 and self.supply_uf < SUPPLY_UF_MIN:
            raise InputError(
                f"supply_uf: {self.supply_uf:g} uF is less than {SUPPLY_UF_MIN:g} uF: with supply_ohm something must"
                " hold what braking motors give back"
            )


SUPPLY_UF_MIN: Final = 100.0
"""Less than any board has; the voltage would change by volts within a step of integration."""
