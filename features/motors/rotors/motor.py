"""Hybrid stepper motors as data: datasheet figures, and the constants of the rotor's equations.

A datasheet gives holding torque with both phases at the rated current, so the motor's constant follows as
Km = T_hold / (sqrt(2) I_rated) (MathWorks, Simscape Electrical, block "Stepper Motor"). No datasheet gives the losses
in the iron. They are assumed: a drag of 8 % of the holding torque at 600 turns a minute (docs/motors.md compares the
pull-out torques that follow with published ones).
"""

from dataclasses import dataclass
from math import pi, sqrt
from typing import Final

FULL_STEPS_PER_TOOTH: Final = 4
"""Full steps in one electrical turn, which is one tooth of the rotor."""

IRON_DRAG_FRACTION: Final = 0.08
"""Drag of the iron at `IRON_DRAG_RPM`, as a fraction of the holding torque. [A]"""
IRON_DRAG_RPM: Final = 600.0

RAD_S_PER_RPM: Final = 2.0 * pi / 60.0


@dataclass(frozen=True, slots=True)
class Motor:
    """One motor, as its datasheet gives it.

    Attributes:
        name: the maker's name.
        resistance_ohm: of one phase, at 25 degC.
        inductance_mh: of one phase.
        holding_torque_nm: with both phases at the rated current.
        rated_current_a: of a phase.
        rotor_inertia_gcm2: of the rotor.
        detent_torque_nm: without current.
        source: origin of the figures.
        full_steps_per_rev: full steps in a turn, four for each tooth.
        iron_drag_nm_s: drag of the iron for each rad/s; None: the assumption above.
        friction_nm: Coulomb friction of the bearings. [A]
        thermal_resistance_k_w: from the windings to the ambient air. [A]
        thermal_time_constant_s: of the motor. [A]

    Raises:
        ValueError: a figure is negative, or 0 where it must be positive.
    """

    name: str
    resistance_ohm: float
    inductance_mh: float
    holding_torque_nm: float
    rated_current_a: float
    rotor_inertia_gcm2: float
    detent_torque_nm: float
    source: str
    full_steps_per_rev: int = 200
    iron_drag_nm_s: float | None = None
    friction_nm: float = 0.005
    thermal_resistance_k_w: float = 6.0
    thermal_time_constant_s: float = 900.0

    def __post_init__(self) -> None:
        for key in ("resistance_ohm", "inductance_mh", "holding_torque_nm", "rated_current_a", "rotor_inertia_gcm2"):
            if not getattr(self, key) > 0.0:
                raise ValueError(f"{key}: {getattr(self, key):g} is not above 0")
        for key in ("detent_torque_nm", "friction_nm"):
            if not getattr(self, key) >= 0.0:
                raise ValueError(f"{key}: {getattr(self, key):g} is negative")

    @property
    def teeth(self) -> int:
        """Nr, the teeth of the rotor: electrical turns in one turn."""
        return self.full_steps_per_rev // FULL_STEPS_PER_TOOTH

    @property
    def torque_constant_nm_a(self) -> float:
        """Km, torque of one phase for each ampere, and its back-EMF in V s."""
        return self.holding_torque_nm / (sqrt(2.0) * self.rated_current_a)

    @property
    def inductance_h(self) -> float:
        """Inductance of one phase."""
        return self.inductance_mh / 1000.0

    @property
    def rotor_inertia_kgm2(self) -> float:
        """Inertia of the rotor."""
        return self.rotor_inertia_gcm2 * 1e-7

    @property
    def drag_nm_s(self) -> float:
        """Drag of the iron's losses in Nm for each rad/s: Km^2 / Rm, Rm being the iron's resistance."""
        if self.iron_drag_nm_s is not None:
            return self.iron_drag_nm_s
        return IRON_DRAG_FRACTION * self.holding_torque_nm / (IRON_DRAG_RPM * RAD_S_PER_RPM)


_STEPPERONLINE: Final = (
    "StepperOnline datasheet, as databases of 3D printers' motors quote it; detent 4 % of holding [A]"
)
_QSH5718: Final = "Trinamic QSH5718 manual; its rated current is an rms figure"

CATALOGUE: Final = {
    motor.name: motor
    for motor in (
        Motor(
            "17HE19-2004S", 1.3, 2.4, 0.55, 2.0, 82.0, 0.022,
            "StepperOnline datasheet; inertia and detent of the 17HS19 [A]",
        ),
        Motor(
            "17HS19-2004S1", 1.4, 3.0, 0.59, 2.0, 82.0, 0.022,
            "StepperOnline datasheet; detent [A]",
        ),
        Motor(
            "23HS22-2804S", 0.9, 2.5, 1.26, 2.8, 300.0, 0.039,
            "StepperOnline datasheet (torque, inertia); resistance and inductance of its class [A]; detent [A]",
        ),
        Motor(
            "23HS30-2804S", 1.13, 5.4, 1.89, 2.8, 440.0, 0.068,
            "klipper_tmc_autotune's database of motors; inertia of StepperOnline's datasheet; detent [A]",
        ),
        Motor(
            "17HS08-1004S", 3.7, 4.5, 0.16, 1.0, 22.0, 0.006,
            "Source Robotics' list of tested motors (STEPFOC-docs) and StepperOnline's title; inertia as a database of"
            " 3D printers' motors quotes it; detent 4 % of holding [A]",
        ),
        Motor("17HS13-0404S", 30.0, 37.0, 0.26, 0.4, 38.0, 0.010, _STEPPERONLINE),
        Motor("17HS16-2004S1", 1.1, 2.6, 0.45, 2.0, 54.0, 0.018, _STEPPERONLINE),
        Motor("17HS19-1684S1", 1.65, 2.8, 0.45, 1.68, 68.0, 0.018, _STEPPERONLINE),
        Motor("17HS24-2104S", 1.6, 3.0, 0.65, 2.1, 148.0, 0.026, _STEPPERONLINE),
        Motor(
            "MS17HD6P4200", 1.3, 2.9, 0.63, 2.0, 82.0, 0.025,
            "klipper_tmc_autotune's database of motors; inertia of the MS17HD6P420I; detent [A]",
        ),
        Motor(
            "MS17HDBP4200", 1.49, 3.8, 0.83, 2.0, 123.0, 0.033,
            "klipper_tmc_autotune's database of motors; inertia of the MS17HDBP4100; detent [A]",
        ),
        Motor("QSH5718-41", 0.6, 1.5, 0.47, 3.0, 77.0, 0.021, _QSH5718),
        Motor("QSH5718-55", 0.8, 2.1, 0.98, 3.0, 209.0, 0.030, _QSH5718),
        Motor("QSH5718-79", 0.8, 3.2, 1.63, 3.0, 335.0, 0.030, _QSH5718),
    )
}  # fmt: skip
"""Motors that robot files may name; a file may also describe its own motor."""
