"""Compare the messages of bad input with one golden file: test and input to message, in messages.json.

A test says only that something is refused, by `refusing`, `complaint_of` or `refusal`, and which error it is. The words
stand in the golden file, under the test's own name. `python -m tests.messages [PATHS]` writes them anew; read the diff.

Words are compared exactly, and numbers to one unit of their last place, since processors round differently. Some
messages end in the words of Python or of a library, so they are compared only where the Python of `_WORDS_OF` runs.
"""

import json
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final, TypeVar

import pytest
from hypothesis import currently_in_test_context

GOLDEN: Final = Path(__file__).with_suffix(".json")
PROJECT: Final = Path(__file__).resolve().parents[1]
_WORDS_OF: Final = (3, 11)  # version of Python whose words the golden file has
_NUMBER: Final = re.compile(r"(?<![\w.])(-?\d+(?:\.\d+)?)(?![\w.]*\w)")
_PROPERTY: Final = "messages"

_Error = TypeVar("_Error", bound=Exception)

_messages: Final[list[str]] = []
"""What was refused in the running test so far."""
_golden: Final[dict[str, list[str]]] = json.loads(GOLDEN.read_text(encoding="utf-8")) if GOLDEN.exists() else {}
_updated: Final[dict[str, list[str]]] = {}


def refused_with(message: str) -> str:
    """Compare a message with the golden file when the running test ends, unless its input is random; return it."""
    if not currently_in_test_context():
        _messages.append(message)
    return message


def forget() -> None:
    """Forget what was refused so far, before a test begins again."""
    _messages.clear()


@contextmanager
def refusing(error: type[_Error] | tuple[type[_Error], ...]) -> Iterator[pytest.ExceptionInfo[_Error]]:
    """Expect an error whose message stands in the golden file."""
    with pytest.raises(error) as caught:
        yield caught
    refused_with(str(caught.value))


def same(message: str, golden: str) -> bool:
    """Return whether two messages have the same words, and numbers that differ by one in the last place at most."""
    parts, others = _NUMBER.split(message), _NUMBER.split(golden)
    if parts[::2] != others[::2]:
        return False
    return all(map(_same_number, parts[1::2], others[1::2]))


def _same_number(number: str, other: str) -> bool:
    decimals = [len(text.partition(".")[2]) for text in (number, other)]
    if decimals[0] != decimals[1] or "." not in number:
        return number == other
    return abs(float(number) - float(other)) <= 1.01 * 10.0 ** -decimals[0]


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add `--update-messages`, by which the golden file gets the messages of the tests that run."""
    parser.addoption("--update-messages", action="store_true", help="write tests/messages.json anew")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Iterator[None]:
    """Compare what a test was refused with, once it has passed otherwise."""
    forget()
    yield
    messages = [_without_places(each, item) for each in _messages]
    if item.config.getoption("update_messages"):
        item.user_properties.append((_PROPERTY, messages))
    elif sys.version_info[:2] == _WORDS_OF:
        golden = _golden.get(item.nodeid, [])
        if len(messages) != len(golden) or not all(map(same, messages, golden)):
            assert messages == golden, "see tests/messages.py"


def _without_places(message: str, item: pytest.Item) -> str:
    """Replace the folders, programs and ports that differ between runs and computers."""
    message = message.replace(str(PROJECT), "PROJECT")
    folder = getattr(item, "funcargs", {}).get("tmp_path")
    if folder is not None:
        message = message.replace(str(folder), "TMP")
    message = re.sub(r"/[^\s:'\"]*/pytest-\d+(/popen-gw\d+)?", "BASE", message)
    message = re.sub(r"(/tmp|TMP)/tmp\w{8}", "TMP", message)
    message = re.sub(r"[^\s'\"(]*bin/python[\d.]*", "PYTHON", message)
    message = re.sub(r"127\.0\.0\.1:\d{4,5}\b", "127.0.0.1:PORT", message)
    return message.replace(str(PROJECT), "PROJECT")


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Take what a worker's test was refused with."""
    if report.when == "call" and report.passed:
        messages = dict(report.user_properties).get(_PROPERTY)
        if messages is not None:
            _updated[report.nodeid] = messages  # type: ignore[assignment]


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Write the golden file: entries of functions that ran are new, those of functions that are gone go."""
    if not session.config.getoption("update_messages") or hasattr(session.config, "workerinput"):
        return
    ran = set(map(_function_of, _updated))
    others = {name: messages for name, messages in _golden.items() if _function_of(name) not in ran}
    entries = {**others, **_updated}
    kept = {name: messages for name, messages in sorted(entries.items()) if messages and exists(name)}
    GOLDEN.write_text(json.dumps(kept, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def _function_of(name: str) -> str:
    return name.partition("[")[0]


def exists(name: str) -> bool:
    """Return whether the file of a test, given by its node id, still has its function."""
    path, _, function = _function_of(name).partition("::")
    file = PROJECT / path
    return file.exists() and f"def {function.split('::')[-1]}(" in file.read_text(encoding="utf-8")


if __name__ == "__main__":
    # In a process of its own: pytest must be the first to import what it rewrites, and this module imports Hypothesis.
    command = [sys.executable, "-m", "pytest", "--update-messages", "--numprocesses", "auto", "--quiet", *sys.argv[1:]]
    sys.exit(subprocess.run(command, check=False).returncode)
