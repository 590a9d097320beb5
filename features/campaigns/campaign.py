"""A campaign as data: which robots make which motions, what goes wrong meanwhile, and what varies from run to run.

Its files are its own text and those that it names, beside it or kept in its folder of results.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from hashlib import sha256
from importlib.resources import files
from pathlib import Path
from typing import Final
from urllib.parse import quote

import steptwin
from steptwin.features.campaigns.values import Template
from steptwin.features.motors.options import MotorsTurn
from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_limits import CAMPAIGN_BYTES_MAX, CAMPAIGN_FILE_BYTES_MAX
from steptwin.host.common.own_files import made_folder, read_text
from steptwin.host.common.whole_file import write_whole
from steptwin.host.planning.trajectory import Trajectory
from steptwin.host.robots.robot import Robot

RUNS_MAX: Final = 10_000_000
"""Greatest number of runs: a list of those that are done takes a byte for each."""
_FOLDERS: Final = ("controller", "emulator", "host", "protocol")
_SUFFIXES: Final = (".py", ".toml")
_DIGITS: Final = 8
"""Digits of the digest: of a thousand versions, two have the same with a chance of 1 in 8600."""


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


@cache
def source_version() -> str:
    """Return the version and a digest of the sources and robot files as they are now, such as `1.0.0+1f3a09bc`.

    A wheel has the same as the checkout that it was built from, also if some of its modules are compiled.
    """
    return f"{steptwin.__version__}+{digest_of(Path(next(iter(steptwin.__path__))))}"


def digest_of(package: Path) -> str:
    """Return the digest of a package's sources and robot files: of their names and contents."""
    digest = sha256()
    for folder in _FOLDERS:
        root = (package / folder).resolve()  # in a checkout it is a link, which rglob does not follow
        for path in sorted(path for path in root.rglob("*") if path.suffix in _SUFFIXES):
            content = path.read_bytes()
            digest.update(f"{folder}/{path.relative_to(root).as_posix()} {len(content)}\n".encode())
            digest.update(content)
    return digest.hexdigest()[:_DIGITS]


NIGHTLY: Final = "nightly"
"""Name of the campaign over the robots of papers and all faults."""
_CAMPAIGN: Final = "campaign.toml"
_FILES: Final = "files"


@dataclass(frozen=True, slots=True)
class Sources:
    """A campaign's text, and where the files are that it names.

    Attributes:
        name: its file as the user named it, for messages.
        text: the text.
        folder: folder from which the names of files count; None for files kept under their quoted names.
        kept: folder of a campaign's results, where its files are kept; None for a campaign of its own file.
    """

    name: str
    text: str
    folder: Path | None = None
    kept: Path | None = None

    def path(self, name: str) -> str:
        """Return the path of a file that the campaign names."""
        if self.kept is not None:
            return str(self.kept / _FILES / quote(name, safe=""))
        return str((self.folder or Path()) / name)

    def keep(self, folder: Path, names: set[str]) -> None:
        """Keep the campaign and its files in a folder of results, unless they are there.

        Raises:
            InputError: the folder has the results of another campaign.
        """
        texts = {_CAMPAIGN: self.text}
        for name in names:
            with prefixed(f"{name}: "):
                texts[f"{_FILES}/{quote(name, safe='')}"] = read_text(self.path(name), CAMPAIGN_FILE_BYTES_MAX)
        if (folder / _CAMPAIGN).exists():
            for place, text in texts.items():
                path = folder / place
                if not path.is_file() or read_text(str(path), CAMPAIGN_FILE_BYTES_MAX) != text:
                    raise InputError(f"{folder}: has the results of another campaign, whose {place} differs")
            return
        folder.mkdir(parents=True, exist_ok=True)
        for place, text in reversed(texts.items()):  # the campaign comes last: with it the folder is whole
            if place.startswith(f"{_FILES}/"):
                made_folder(folder / _FILES)
            write_whole(folder / place, text)


def sources_of_file(path: str) -> Sources:
    """Read a campaign's file, or by its name the one that StepTwin brings; raise InputError if it cannot be read."""
    if path == NIGHTLY:
        return Sources(path, (files(__package__) / f"{NIGHTLY}.toml").read_text(encoding="utf-8"))
    with prefixed(f"{path}: "):
        return Sources(path, read_text(path, CAMPAIGN_BYTES_MAX), folder=Path(path).parent)


def sources_of_results(folder: Path) -> Sources:
    """Read the campaign in a folder of results; raise InputError for a folder without one."""
    path = folder / _CAMPAIGN
    if not path.is_file():
        raise InputError(f"{folder}: holds no campaign: there is no {_CAMPAIGN} in it")
    with prefixed(f"{path}: "):
        return Sources(str(path), read_text(str(path), CAMPAIGN_BYTES_MAX), kept=folder)
