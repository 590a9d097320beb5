"""Uploaded files: the file to run, and those to which a program refers.

A browser sends a file's name without its folder, so references are resolved by their last part. A program from a
browser can read no other file of this computer.
"""

import tomllib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from typing import Any, Final

from steptwin.host.common.errors import InputError
from steptwin.host.planning.programs import SUFFIX
from steptwin.host.planning.programs.program_file import verb_of_suffix
from steptwin.host.planning.programs.step_files import step_program
from steptwin.host.planning.trajectory_file import SUFFIXES
from steptwin.host.robots.robot import Robot

_VERBS: Final = verb_of_suffix()
"""Verb of the step that runs a file with this suffix."""
RUNNABLE: Final = (*SUFFIXES, SUFFIX, *_VERBS)
_KEYS: Final = (*dict.fromkeys(_VERBS.values()), "positions_file")
"""Keys of a program, besides `robot`, that name a file."""


def to_run(files: Mapping[str, bytes]) -> str | None:
    """Return the name of the file to run: the newest one to which no program refers; None without one."""
    programs = {name: document for name in files if (document := _program(name, files[name])) is not None}
    named = {_plain(reference) for document in programs.values() for _, reference in _references(document)}
    runnable = [name for name in files if name not in named and (name in programs or not name.endswith(SUFFIX))]
    return next(reversed(runnable or list(files)), None)


def companions(files: Mapping[str, bytes]) -> list[str]:
    """Return the names of the files that belong to the file to run: robots, positions, and its references."""
    main = to_run(files)
    if main is None:
        return []
    named = {_plain(reference) for _, reference in _references(_program(main, files[main]) or {})}
    others = (name for name in files if name != main)
    return [name for name in others if name in named or (name.endswith(SUFFIX) and _program(name, files[name]) is None)]


@contextmanager
def uploaded(name: str, content: bytes, beside: Mapping[str, bytes], robot: Robot) -> Iterator[str]:
    """Write a file and its references for the block; errors use the user's names."""
    plain = Path(name).name
    ending = Path(plain).suffix.lower()
    if ending not in RUNNABLE:
        raise InputError(f"{plain}: a file to run ends in {', '.join(RUNNABLE)}")
    files: dict[str, bytes] = {}
    if ending in _VERBS:
        files[plain], content, ending = content, step_program(plain).encode(), SUFFIX
    elif ending == SUFFIX:
        files = _referred(plain, content, beside, robot)
    with TemporaryDirectory(prefix="steptwin-") as folder:
        deep = max((reference.count("../") for reference in files), default=0)
        own = Path(folder, *["upload"] * deep)
        own.mkdir(parents=True, exist_ok=True)
        for reference, data in files.items():
            _write(own / reference, data, f"{plain}: {reference}: is no name of a file")
        path = own / f"{_free('upload', files)}{ending}"
        path.write_bytes(content)
        try:
            yield str(path)
        except InputError as error:
            messages = (_as_known(message, path, plain) for message in error.messages)
            raise InputError(*messages).plainly(_as_known(error.plain, path, plain)) from error


def _write(path: Path, data: bytes, wrong: str) -> None:
    """Write a file; raise InputError for a name that is impossible."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    except (OSError, ValueError) as error:
        raise InputError(wrong) from error


def _as_known(text: str, path: Path, plain: str) -> str:
    return text.replace(str(path), plain).replace(f"{path.parent}/", "")


def _free(stem: str, files: Mapping[str, bytes]) -> str:
    while any(PurePosixPath(name).stem == stem for name in files):
        stem += "_"
    return stem


def _referred(plain: str, content: bytes, beside: Mapping[str, bytes], robot: Robot) -> dict[str, bytes]:
    """Return the contents of the files that a program names, by name; raise InputError if one is missing."""
    known = {_plain(name): data for name, data in beside.items()}
    found: dict[str, bytes] = {}
    for key, reference in _references(_program(plain, content) or {}):
        last = _plain(reference)
        if PurePosixPath(reference).is_absolute():
            raise InputError(
                f"{plain}: {key}: {reference}: is a place on a computer; name it {last}, and upload it, too"
            )
        if last in known:
            found[reference] = known[last]
        elif key == "robot" and Path(last).stem == robot.name and robot.toml:
            found[reference] = robot.toml.encode()
        elif key == "robot":
            raise InputError(
                f"{plain}: robot: {reference}: is not uploaded, and the machine is {robot.name}: choose both files"
                f" at once, or leave the line out"
            )
        else:
            raise InputError(f"{plain}: {key}: {reference}: is not uploaded: choose both files at once")
    return found


def _program(name: str, content: bytes) -> dict[str, Any] | None:
    """Return the document of a program; None for another file. Invalid TOML counts as a program with an error."""
    if Path(name).suffix.lower() != SUFFIX:
        return None
    try:
        document = tomllib.loads(content.decode("utf-8-sig"))
    except (ValueError, RecursionError):
        return {}
    return document if "step" in document or not ({"joints", "joint", "positions"} & document.keys()) else None


def _references(document: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return the files that a program names at any depth, each with its key."""
    robot = document.get("robot")
    named = [("robot", robot)] if isinstance(robot, str) and robot.endswith(SUFFIX) else []
    waiting: list[Any] = [document]
    while waiting:
        now = waiting.pop()
        if isinstance(now, Mapping):
            named += [(key, now[key]) for key in _KEYS if isinstance(now.get(key), str) and now[key]]
            waiting.extend(now.values())
        elif isinstance(now, list):
            waiting.extend(now)
    return named


def _plain(name: str) -> str:
    return PurePosixPath(name).name
