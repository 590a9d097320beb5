"""The SCARA-type robots of five papers: their files, mechanisms and experiments; imports the core alone."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from steptwin.host.common.features import Feature

if TYPE_CHECKING:
    from steptwin.host.planning.jobs.job import Job
    from steptwin.host.robots.kinematics.kinds import Kind


def _kinematics() -> "Mapping[str, Kind]":
    from steptwin.features.papers import scaras
    from steptwin.features.papers.hybrid_arm import HybridArm, HybridGeometry
    from steptwin.host.robots.kinematics.kinds import Kind

    return {
        "teaching-scara": Kind(
            "a SCARA with lift and rotation at its end, tool up", scaras.TeachingGeometry, scaras.teaching_scara
        ),
        "lab-scara": Kind("a SCARA on a lift that heads for +y, tool down", scaras.LabGeometry, scaras.lab_scara),
        "calibration-scara": Kind(
            "a SCARA on a column in standard DH parameters, lift last",
            scaras.CalibrationGeometry,
            scaras.calibration_scara,
        ),
        "warehouse-scara": Kind(
            "a SCARA with a lift, carried by a horizontal and a vertical slide",
            scaras.WarehouseGeometry,
            scaras.warehouse_scara,
        ),
        "hybrid-arm": Kind("a waist with a parallel mechanism of two sliders", HybridGeometry, HybridArm.of),
    }


def _jobs() -> "Mapping[str, Sequence[Job[Any]]]":
    from steptwin.features.papers.carry import CARRY
    from steptwin.features.papers.demo import DEMO
    from steptwin.features.papers.hybrid_jobs import FIVE_POINTS, HELIX
    from steptwin.features.papers.pull_line import PULL_LINE
    from steptwin.features.papers.spiral import SPIRAL

    return {
        "lab-scara": (SPIRAL,),
        "warehouse-scara": (PULL_LINE,),
        "teaching-scara": (CARRY,),
        "calibration-scara": (DEMO,),
        "hybrid-arm": (FIVE_POINTS, HELIX),
    }


FEATURE: Final = Feature(
    name="papers",
    robots=Path(__file__).parent / "robots",
    kinematics=_kinematics,
    jobs=_jobs,
)
