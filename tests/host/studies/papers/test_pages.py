"""A page from a paper of two items: Markdown, HTML, verdict; and what every paper's data has to keep."""

import ast
import re
from dataclasses import dataclass, replace
from math import isnan, nan
from pathlib import Path

import numpy as np
import pytest

from steptwin.host.cli.app import run
from steptwin.host.common.errors import InputError
from steptwin.host.planning.jobs import job_names
from steptwin.host.robots import MACHINES, load_robot, robot_names
from steptwin.host.studies import papers as writing
from steptwin.host.studies.papers import PAPERS, EvaluatedPaper, Runs, evaluated, to_html
from steptwin.host.studies.papers.paper import Basis, Computed, Coverage, Curve, Panel, Paper, PictureKind, Rows
from steptwin.host.studies.papers.paper_file import read_paper
from steptwin.host.studies.papers.paper_page import errata_table, render_page
from steptwin.host.studies.papers.study import Study
from tests.end_to_end.command_line import refusal, run_json
from tests.messages import refusing

TEXT = """
citation = 'A. Author, "A length"'

[[items]]
place = "Fig. 1"
title = "a length"
text = "Some text with <b>a tag</b> in it."
parts = [
    ["fig. 1", "a line", "picture below"],
    ["fig. 3", "a circle", "nowhere", "no", "nobody drew it"],
]
left_open = [["fig. 1", "its scale", "1 : 1"]]
lost = [["fig. 1", "its colour", "black"], ["fig. 2", "all of it", "nothing"]]
listings = [{ title = "Squares", columns = ["name", "mm2"], rows = "squares" }]
pictures = [{ place = "fig. 1", plot = "line", name = "line", caption = "A line" }]

[[items.values]]
result = "length"
place = "fig. 1"
source = "read off"
paper = 10.00
unit = "mm"
ours = "lengths.0"
tolerance = 0.25
decimals = 3

[[items.values]]
alone = "twice the length"
unit = "mm"
ours = "twice"
decimals = 1

[[items.values]]
dimension = "ten"
place = "table 1"
paper = 10.0
unit = "mm"
ours = "figures.ten"

[[items.values]]
check = "none"
expected = 0.0
ours = "figures.none"
tolerance = 1e-9
decimals = 1

[[items]]
place = "Eq. 2"
title = "its half"

[[items.errata]]
place = "eq. 2"
printed = "2 x"
right = "x / 2"
found = "a ruler"
formulas = [{ what = "half", unit = "mm", compute = "half", truth_from = "a ruler", decimals = 2 }]

[[items.errata]]
place = "eq. 3"
printed = "a"
right = "b"
found = "the text"
"""


@dataclass(frozen=True)
class LengthStudy(Study):
    """A length."""

    robot_name = "lab-scara"
    at = shown = (0.0, 0.0, 0.0, 0.0)
    ours_mm: float = 10.25
    printed_mm: float = 20.0

    @property
    def lengths(self) -> list[float]:
        return [self.ours_mm]

    @property
    def twice(self) -> float:
        return 2 * self.ours_mm

    @property
    def figures(self) -> dict[str, float]:
        return {"ten": 10.0, "none": 0.0}

    @property
    def half(self) -> Computed:
        return Computed(self.printed_mm, self.ours_mm / 2, self.ours_mm / 2)

    @property
    def squares(self) -> Rows:
        return [["a | b", f"{self.ours_mm**2:.2f}"]]

    @property
    def line(self) -> tuple[Panel, ...]:
        ends_mm = np.array([0.0, self.ours_mm])
        return (Panel("", "x [mm]", "y [mm]", (Curve("a", ends_mm, ends_mm),)),)


def made(ours_mm: float = 10.25, printed_mm: float = 20.0) -> Paper:
    """Return a paper of two items, whose study is one length."""
    paper = read_paper(TEXT, LengthStudy)
    return replace(paper, study=lambda runs: LengthStudy(runs, ours_mm, printed_mm))


def page(**numbers: float) -> EvaluatedPaper:
    return evaluated(made(**numbers), Runs())


def test_the_page() -> None:
    text = render_page(page())
    assert "| length | fig. 1 (read off) | 10 mm | 10.250 mm | 0.250 | 0.25 | yes |" in text
    assert "| ten | table 1 | 10 mm | 10 mm | yes |" in text
    assert "| none | 0 | 0.0 | 1e-09 | yes |" in text
    assert "| fig. 3 | a circle | [Fig. 1](#fig-1-a-length): nowhere | no | nobody drew it |" in text
    assert "| twice the length | 20.5 mm |" in text
    assert "| a \\| b | 105.06 |" in text
    assert "## What the paper leaves open\n\n| place | what is open | here |" in text
    assert "| fig. 2 | all of it | nothing |" in text
    assert "| eq. 2 | 2 x | x / 2 | a ruler |" in text
    assert "| eq. 2: half | a ruler | 20.00 mm | 5.12 mm | 5.12 mm |" in text
    assert "![fig. 1: A line](lab-scara-line.png)" in text
    assert "![" not in render_page(page(), with_pictures=False)
    assert "- Items of the paper: 2; found here: 1 yes, 0 partly, 1 no." in text
    assert "twin reproduces: 1 of 1. Dimensions taken over: 1. Self-checks that hold: 1 of 1." in text
    assert "Left open by the paper: 1. Lost in our copy: 2." in text
    assert errata_table(made()).count("\n") == 3


@pytest.mark.parametrize(
    ("numbers", "complaint"),
    [
        ({"ours_mm": 10.2500001}, "Fig. 1: length: 10.2500001, the paper has 10"),
        ({"ours_mm": 9.7499999}, "Fig. 1: length: 9.7499999, the paper has 10"),
        ({"printed_mm": 5.125}, "eq. 2: half: 5.125 as printed, 5.125 as corrected, 5.125 is right"),
        ({"ours_mm": nan}, "Fig. 1: length: nan, the paper has 10"),
    ],
)
def test_what_does_not_agree(numbers: dict[str, float], complaint: str) -> None:
    wrong = page(**numbers)
    assert not wrong.agrees
    assert next(wrong.disagreements) == complaint
    assert ("| NO |" in render_page(wrong)) == ("length" in complaint)


@pytest.mark.parametrize("printed_mm", [nan, 5.2, -1e9])
def test_what_agrees(printed_mm: float) -> None:
    right = page(ours_mm=9.75, printed_mm=printed_mm)
    assert right.agrees
    assert list(right.disagreements) == []
    assert ("no value" in render_page(right)) == isnan(printed_mm)


def test_html_needs_no_other_file() -> None:
    text = to_html(render_page(page()), "A <title>", {"lab-scara-line.png": b"\x89PNG"})
    assert "<title>A &lt;title&gt;</title>" in text
    assert "&lt;b&gt;a tag&lt;/b&gt;" in text
    assert re.findall(r'src="([^"]{1,22})', text) == ["data:image/png;base64,"]
    links = re.findall(r'href="#([^"]+)"', text)
    assert links == ["fig-1-a-length"] * 2
    assert set(links) <= set(re.findall(r'id="([^"]+)"', text))
    assert len(links) == text.count("href=")
    assert '<img src="data:image/png;base64,iVBORw==" alt="fig. 1: A line" />' in text
    assert "<!--" not in text
    with pytest.raises(KeyError):
        to_html(render_page(page()), "", {})


@pytest.mark.slow
def test_a_folder_without_matplotlib_and_with_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "other.md").write_text("stays")
    with monkeypatch.context() as patch:
        patch.setattr(writing, "find_spec", lambda _: None)
        assert not writing.write_paper(tmp_path, page(), Runs())
    assert {path.name for path in tmp_path.iterdir()} == {"other.md", "lab-scara.md", "lab-scara.html"}
    assert "![" not in (tmp_path / "lab-scara.md").read_text()
    pytest.importorskip("matplotlib")
    assert writing.write_paper(tmp_path, page(), Runs())
    assert (tmp_path / "lab-scara-line.png").read_bytes().startswith(b"\x89PNG")
    assert "data:image/png" in (tmp_path / "lab-scara.html").read_text()


class TestCommand:
    """`steptwin paper`, with the made paper in place of the laboratory robot's."""

    @pytest.fixture(autouse=True)
    def _made(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setitem(PAPERS, "lab-scara", made())

    @pytest.mark.slow
    def test_it_prints_and_writes(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        pytest.importorskip("matplotlib")
        out = tmp_path / "new" / "folder"
        assert run(["paper", "lab-scara", "--out", str(out)]) == 0
        printed = capsys.readouterr().out
        assert 'A. Author, "A length"' in printed
        assert "10.250" in printed
        assert f"page and pictures are in {out}/: lab-scara.md, lab-scara.html" in printed
        assert {path.name for path in out.iterdir()} == {"lab-scara.md", "lab-scara.html", "lab-scara-line.png"}

    def test_json(self, capsys: pytest.CaptureFixture[str]) -> None:
        document = run_json(capsys, "paper", "lab-scara")
        assert document["agrees"] is True
        figure, equation = document["items"]
        assert figure["place"] == "Fig. 1"
        assert figure["values"][0] == {
            "kind": "result", "what": "length", "unit": "mm", "place": "fig. 1", "paper": 10.0, "expected": 10.0,
            "source": "read off", "ours": 10.25, "difference": 0.25, "tolerance": 0.25, "agrees": True,
        }  # fmt: skip
        assert figure["values"][1]["paper"] is figure["values"][1]["agrees"] is None
        assert equation["errata"][0]["formulas"][0]["proven"] is True

    def test_a_number_that_does_not_agree(
        self, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setitem(PAPERS, "lab-scara", made(ours_mm=11.0))
        assert run(["paper", "lab-scara"]) == 1
        assert capsys.readouterr().err == "Fig. 1: length: 11, the paper has 10\n"

    def test_bad_input(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        refusal(capsys, "paper")
        told = refusal(capsys, "paper", "lab-scra")
        assert told == "paper of robot 'lab-scra' is unknown: did you mean lab-scara?"
        told = refusal(capsys, "paper", "mine.toml")
        assert told == f"paper of robot 'mine.toml' is unknown: there are {', '.join(PAPERS)}"
        (file := tmp_path / "file").write_text("mine")
        refusal(capsys, "paper", "lab-scara", "--out", str(file))
        assert file.read_text() == "mine"


def test_every_robot_has_its_paper() -> None:
    assert set(PAPERS) == set(robot_names()) - set(MACHINES)
    assert all(name == paper.robot for name, paper in PAPERS.items())


PLACE = re.compile(
    r"(title|abstract|introduction|conclusion|text|verification|inverse|virtual prototype|the whole paper|sects?\. \d"
    r"|(tables?|figs?\.|eqs?\.) \d|parameter text|no place in the paper)"
)
"""How a place in a paper begins: with the paper's own number, or with the name of an unnumbered part."""


@pytest.mark.parametrize("robot", PAPERS)
def test_the_data_of_every_paper(robot: str) -> None:
    """Places are named once, pictures too; jobs of runs exist; what is the paper's has its place there."""
    paper = PAPERS[robot]
    places = [item.place for item in paper.items]
    assert len(set(places)) == len(places)
    pictures = [picture for item in paper.items for picture in item.pictures]
    assert len({picture.name for picture in pictures}) == len(pictures)
    for picture in pictures:
        assert picture.kind is not PictureKind.RUN or picture.job in job_names(load_robot(robot))
    for item in paper.items:
        stated = [part.place for part in item.parts] + [erratum.place for erratum in item.errata]
        stated += [gap.place for gap in (*item.left_open, *item.lost)] + [picture.place for picture in item.pictures]
        stated += [one.place for one in item.values if one.kind in {Basis.DIMENSION, Basis.RESULT}]
        for place in (*stated, item.place.lower()):
            assert PLACE.match(place), (item.place, place)
        for one in item.values:
            assert bool(one.place) is (one.source is not None) is (one.kind in {Basis.DIMENSION, Basis.RESULT}), (
                one.what
            )
        assert all(part.why for part in item.parts if part.answer is not Coverage.YES)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("paper = 10.00", 'paper = "reach_mm"'),
        ('place = "table 1"', ""),
        ('place = "table 1"', 'place = ""'),
        ('dimension = "ten"', 'length = "ten"'),
        ("expected = 0.0", "paper = 0.0"),
        ('"read off"', '"guessed"'),
        ('"A line"', "3"),
        ("plot = ", "drawing = "),
        ('"no", "nobody', '"never", "nobody'),
        ('"picture below"', '"a", "yes", "", ""'),
        ('[["fig. 1", "its scale", "1 : 1"]]', "[[1, 2, 3]]"),
        ('"its scale", "1 : 1"', '"its scale"'),
    ],
)
def test_a_file_that_says_less_or_else(old: str, new: str) -> None:
    """What stands on the paper's side is a number in its file, with its place: no name of ours can stand there."""
    assert TEXT.count(old) == 1
    with refusing(InputError):
        read_paper(TEXT.replace(old, new), LengthStudy)


def test_only_the_reader_of_the_files_makes_values() -> None:
    """So no study of ours, which computes, can put a number on the paper's side."""
    folder = Path(writing.__file__).parent
    makers = {
        path.name
        for path in folder.glob("*.py")
        for call in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id == "Value"
    }
    assert makers == {"paper_file.py"}


def test_the_items_of_the_papers_are_counted() -> None:
    """93 items were found in the five papers by a reader who went through them sentence by sentence."""
    assert sum(len(paper.parts) for paper in PAPERS.values()) == 93
    assert not [part for paper in PAPERS.values() for part in paper.parts if part.answer is Coverage.NO]
