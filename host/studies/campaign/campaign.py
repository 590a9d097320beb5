"""A campaign as data: which robots make which motions, what goes wrong meanwhile, and what varies from run to run."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from steptwin.host.common.choices import MotorsTurn
from steptwin.host.planning.trajectory import Trajectory
from steptwin.host.robots.robot import Robot
from steptwin.host.studies.campaign.values import Template

RUNS_MAX: Final = 10_000_000
"""Greatest number of runs: a list of those that are done takes a byte for each."""


@dataclass(frozen=True, slots=True)
class JobMotion:
    """A job of the robot; its options are templates by name."""

    job: str
    options: Mapping[str, Template]

    def __str__(self) -> str:
        return self.job


@dataclass(frozen=True, slots=True)
class RandomMoves:
    """Moves of all joints to random positions around the robot's home, one after the other, jerk-limited.

    Attributes:
        moves: how many; a template.
        reach: how far from home, as a part of each joint's range, at most; a template.
    """

    moves: Template
    reach: Template

    def __str__(self) -> str:
        return "random moves"


@dataclass(frozen=True, slots=True)
class CampaignMotion:
    """A motion of a trajectory file or a program: its trajectory for each robot that makes it, by the robot's name."""

    file: str
    trajectories: Mapping[str, Trajectory]

    def __str__(self) -> str:
        return self.file


@dataclass(frozen=True, slots=True)
class MotionChoice:
    """A motion that runs may make, the names of the robots that make it, and how often it is chosen."""

    motion: JobMotion | RandomMoves | CampaignMotion
    robots: tuple[str, ...]
    weight: float


@dataclass(frozen=True, slots=True)
class ScenarioChoice:
    """A scenario that runs may meet: a template of a scenario's table without its name and seed.

    Attributes:
        name: its name in results.
        table: the template; a run without a fault has an empty one.
        robots: names of the robots that meet it.
        weight: how often it is chosen, beside the others.
        vary: templates of parameters for its runs, instead of the campaign's, by name.
        motors: when the motors of its runs turn; None: never.
    """

    name: str
    table: Template
    robots: tuple[str, ...]
    weight: float
    vary: Mapping[str, Template] = field(default_factory=dict)
    motors: MotorsTurn | None = None


@dataclass(frozen=True, slots=True)
class Campaign:
    """All runs that a campaign may draw; equal campaigns draw equal runs.

    Attributes:
        runs: number of runs.
        first_seed: seed of the first; the others have the next ones.
        robots: the robots by name.
        motions: the motions to choose from.
        scenarios: the scenarios to choose from.
        vary: a template for each parameter that varies, by its name in `variations.VARIATIONS`.
        recover: True to recover every machine after its run: repair it, reset, home, move.
        motors: when the motors of runs turn whose scenario does not say it; None: never.
    """

    runs: int
    first_seed: int
    robots: Mapping[str, Robot]
    motions: tuple[MotionChoice, ...]
    scenarios: tuple[ScenarioChoice, ...]
    vary: Mapping[str, Template]
    recover: bool = True
    motors: MotorsTurn | None = None

    @property
    def seeds(self) -> range:
        """The seeds of all runs."""
        return range(self.first_seed, self.first_seed + self.runs)
