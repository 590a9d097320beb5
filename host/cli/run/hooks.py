"""Let features take part in `steptwin run`: before the motion is planned, as it runs, and after it."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

from steptwin.host.common.errors import InputError
from steptwin.host.common.features import giving
from steptwin.host.twin.machine.machine_options import merged

if TYPE_CHECKING:
    from pathlib import Path

    from steptwin.host.cli.arguments import AnswerOptions
    from steptwin.host.client import Progress
    from steptwin.host.common.features import Telling
    from steptwin.host.robots.robot import Robot
    from steptwin.host.twin.embedded.outcome import Outcome


class Prepared(NamedTuple):
    """What a feature has prepared for a run.

    Attributes:
        options: the job's options.
        extra: options of the emulated machine; None without any.
        kept: what its `finish` is given.
    """

    options: Mapping[str, str]
    extra: Any = None
    kept: Any = None


class Added(NamedTuple):
    """What a feature adds to a run that has ended.

    Attributes:
        outcome: the run, with what the feature has found.
        print: prints what it has found, after the report.
        save: writes files of its own into the run's folder; the second argument says whether there are pictures.
        answer: the sentence with which the run's report begins; empty for none.
    """

    outcome: "Outcome"
    print: Callable[[], None]
    save: "Callable[[Path, bool], None]"
    answer: str = ""


class RunHook:
    """A feature's options of `steptwin run`, with what they do: a dataclass that is derived from this."""

    __slots__ = ()

    @property
    def loads_numba(self) -> bool:
        """True if numba is loaded in any case, if it is installed."""
        return False

    def words_taken(self, _robot: "Robot") -> int:
        """Return how many words after the job it takes."""
        return 0

    def prepare(self, _robot: "Robot", _job: str, options: Mapping[str, str], _words: Sequence[str]) -> Prepared:
        """Prepare a run; raise InputError if that cannot be done."""
        return Prepared(options)

    def watching(self, progress: "Progress") -> "Progress":
        """Return what is told of the run's progress, and tells it."""
        return progress

    def add(self, _outcome: "Outcome") -> Added | None:
        """Look at a run that has ended, before it is told and kept; None if there is nothing to add."""
        return None

    def finish(self, _robot: "Robot", _kept: Any) -> str:
        """Do what is to be done after a verified run; return a line about it, which may be empty."""
        return ""


@dataclass(frozen=True, slots=True)
class PreparedRun:
    """A run that all features have prepared.

    Attributes:
        job: the job, or the file.
        options: the job's options.
        extras: the features' options of the emulated machine.
    """

    job: str
    options: Mapping[str, str]
    extras: Sequence[Any]
    _kept: Sequence[tuple[RunHook, Any]]

    def finish(self, robot: "Robot") -> list[str]:
        """Let the features finish a verified run; return their lines."""
        return [line for hook, kept in self._kept if (line := hook.finish(robot, kept))]


def prepare_run(
    hooks: Sequence[RunHook], robot: "Robot", words: Sequence[str], options: Mapping[str, str]
) -> PreparedRun:
    """Let features prepare a run.

    Args:
        hooks: the features' options.
        robot: the robot.
        words: the job or file, and the words behind it, which the features take in turn.
        options: the job's options.

    Raises:
        InputError: there is no job, or a word that no feature takes, or a feature cannot prepare the run.
    """
    if not words:
        raise InputError("one JOB or FILE is needed after the robot, not nothing")
    job, rest = words[0], list(words[1:])
    if len(rest) > sum(hook.words_taken(robot) for hook in hooks):
        raise InputError(f"one JOB or FILE is needed after the robot, not {' '.join(words)}")
    from steptwin.host.planning.jobs import job_extras, job_names

    prepared_extras, kept = list[Any](), list[tuple[RunHook, Any]]()
    for hook in hooks:
        count = hook.words_taken(robot)
        prepared = hook.prepare(robot, job, options, rest[:count])
        options, rest = prepared.options, rest[count:]
        prepared_extras += [] if prepared.extra is None else [prepared.extra]
        kept.append((hook, prepared.kept))
    of_job = job_extras(robot, job, options) if job in job_names(robot) else []
    return PreparedRun(job, options, merged(prepared_extras, of_job), kept)


def tellings() -> "list[Telling]":
    """Return what prints the features' keys of documents."""
    return [made() for _, made in giving("telling")]


@contextmanager
def telling_unbegun(answer: "AnswerOptions") -> Iterator[None]:
    """Print what features say of a run if an error ends the block before the motion has begun."""
    from steptwin.host.twin.embedded.outcome import NotBegunError

    try:
        yield
    except NotBegunError as error:
        document = error.to_dict()
        answer.tell({"passed": False, **document}, *(partial(each.print_run, document) for each in tellings()))
        raise
