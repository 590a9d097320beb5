"""docs/evidence.md, real boards: its commands are valid, and it names exactly the objects that the commands use."""

import re
import shlex

import pytest

from steptwin.host.cli.app import run
from steptwin.host.common.errors import BusError
from steptwin.protocol import od
from steptwin.protocol.objects import OBJECTS
from tests.end_to_end.pages import ROOT, blocks_of, read_page

PAGE = read_page("docs/evidence.md").partition("\n## With a real board\n")[2].partition("\n## ")[0]
ADAPTERS = [
    shlex.split(line, comments=True)
    for language, block in blocks_of(PAGE)
    if language == "sh"
    for line in block.splitlines()
    if " -i " in line
]
INDEX = re.compile(r"\b0x([0-9A-F]{4})\b")


def test_there_are_adapters() -> None:
    assert [words[words.index("-i") + 1] for words in ADAPTERS] == ["socketcan", "slcan", "pcan", "kvaser"]


@pytest.mark.parametrize("words", ADAPTERS, ids=lambda words: words[words.index("-i") + 1])
def test_an_adapter_that_is_not_there(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    """The command is valid: one line with the interface's own error, and the exit code of a bus that does not work."""
    words = ["no-such-device" if word in ("can0", "/dev/ttyACM0") else word for word in words]
    assert run(words[1:]) == BusError.exit_code
    captured = capsys.readouterr()
    assert captured.out.startswith(f"[FAIL] bus: {words[words.index('-i') + 1]} ")
    assert len(captured.out.splitlines()) == 1


def test_every_object_that_commands_rely_on_is_named() -> None:
    """The page names every object that the client and the operator's commands read or write; `monitor` only listens."""
    client = [path for path in (ROOT / "host" / "client").glob("*.py") if path.name != "monitor.py"]
    sources = [*client, *(ROOT / "host" / "operate").glob("*.py")]
    known = {item.index for item in OBJECTS}
    texts = [path.read_text(encoding="utf-8") for path in sources]
    names = {name for text in texts for name in re.findall(r"\bod\.([A-Z][A-Z0-9_]*)\b", text)}
    values = [getattr(od, name) for name in names]
    addresses = {each for value in values for each in (value if isinstance(value, tuple) else (value,))}
    used = {address >> 8 for address in addresses} & known
    assert len(used) > 30
    named = {int(text, 16) for text in INDEX.findall(PAGE)}
    for first, last in re.findall(r"0x([0-9A-F]{4}) to 0x([0-9A-F]{4})", PAGE):
        named |= set(range(int(first, 16), int(last, 16) + 1))
    assert used <= named
    assert named <= known
