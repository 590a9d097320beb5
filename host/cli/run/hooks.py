"""Hooks of features in `steptwin run`: before planning, during the run, and after it."""

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
    """Result of a feature's preparation of a run.

    Attributes:
        options: the job's options.
        extra: options of the emulated machine; None without any.
        kept: argument of its `finish`.
    """

    options: Mapping[str, str]
    extra: Any = None
    kept: Any = None


class Added(NamedTuple):
    """Addition of a feature to an ended run.

    Attributes:
        outcome: the run, with the feature's evidence.
        print: prints the evidence, after the report.
        save: writes files into the run's folder; the second argument is True if there are pictures.
        answer: first sentence of the run's report; empty for none.
    """

    outcome: "Outcome"
    print: Callable[[], None]
    save: "Callable[[Path, bool], None]"
    answer: str = ""


class RunHook:
    """A feature's options of `steptwin run` and their effects: base class of a dataclass."""

    __slots__ = ()

    @property
    def loads_numba(self) -> bool:
        """True if the run loads numba in any case, if it is installed."""
        return False

    def words_taken(self, _robot: "Robot") -> int:
        """Return the number of words that it takes after the job."""
        return 0

    def prepare(self, _robot: "Robot", _job: str, options: Mapping[str, str], _words: Sequence[str]) -> Prepared:
        """Prepare a run; raise InputError if that is impossible."""
        return Prepared(options)

    def watching(self, progress: "Progress") -> "Progress":
        """Return a progress function in place of `progress`."""
        return progress

    def add(self, _outcome: "Outcome") -> Added | None:
        """Examine an ended run before it is reported and stored; None for no addition."""
        return None

    def finish(self, _robot: "Robot", _kept: Any) -> str:
        """Complete a verified run; return a line about it, which may be empty."""
        return ""


@dataclass(frozen=True, slots=True)
class PreparedRun:
    """A run prepared by all features.

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
        """Let features complete a verified run; return their lines."""
        return [line for hook, kept in self._kept if (line := hook.finish(robot, kept))]


def prepare_run(
    hooks: Sequence[RunHook], robot: "Robot", words: Sequence[str], options: Mapping[str, str]
) -> PreparedRun:
    """Let features prepare a run.

    Args:
        hooks: the features' options.
        robot: the robot.
        words: the job or file, and further words for features, in turn.
        options: the job's options.

    Raises:
        InputError: there is no job, a word is not taken by any feature, or a feature cannot prepare the run.
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
    """Return the printers of the features' keys of documents."""
    return [made() for _, made in giving("telling")]


@contextmanager
def telling_unbegun(answer: "AnswerOptions") -> Iterator[None]:
    """Print the features' verdicts if an error ends the block before the motion has begun."""
    from steptwin.host.twin.embedded.outcome import NotBegunError

    try:
        yield
    except NotBegunError as error:
        document = error.to_dict()
        answer.tell({"passed": False, **document}, *(partial(each.print_run, document) for each in tellings()))
        raise
