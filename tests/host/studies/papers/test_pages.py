"""A page from a paper of two items: Markdown, HTML, verdict; and what every paper's data has to keep."""

import ast
import inspect
import re
from math import isnan, nan
from pathlib import Path

import numpy as np
import pytest

from steptwin.host.cli.app import run
from steptwin.host.planning.jobs import job_names
from steptwin.host.robots import load_robot, robot_names
from steptwin.host.studies.papers import PAPERS, EvaluatedPaper, Runs, evaluated
from steptwin.host.studies.papers import paper_folder as writing
from steptwin.host.studies.papers.paper import (
    READ_OFF,
    Basis,
    Coverage,
    Curve,
    Erratum,
    Formula,
    Gap,
    Item,
    Listing,
    Panel,
    Paper,
    Part,
    Plot,
    RunPicture,
    alone,
    dimension,
    result,
    self_check,
)
from steptwin.host.studies.papers.paper_folder import to_html
from steptwin.host.studies.papers.paper_page import errata_table, render_page
from tests.end_to_end.command_line import refusal, run_json


def made(ours_mm: float = 10.25, printed_mm: float = 20.0) -> Paper[float]:
    """Return a paper whose study is one length."""

    def line(length_mm: float) -> tuple[Panel, ...]:
        ends_mm = np.array([0.0, length_mm])
        return (Panel("", "x [mm]", "y [mm]", (Curve("a", ends_mm, ends_mm),)),)

    item: Item[float] = Item(
        "Fig. 1",
        "a length",
        "Some text with <b>a tag</b> in it.",
        parts=(
            Part("fig. 1", "a line", "picture below"),
            Part("fig. 3", "a circle", "nowhere", Coverage.NO, "nobody drew it"),
        ),
        values=(
            result("fig. 1", "length", "mm", 10.0, lambda length_mm: length_mm, 0.25, 3, READ_OFF),
            alone("twice the length", "mm", lambda length_mm: 2 * length_mm, 1),
            dimension("table 1", "ten", "mm", 10.0, lambda _: 10.0),
            self_check("none", "", 0.0, lambda _: 0.0, 1e-9, 1),
        ),
        left_open=(Gap("fig. 1", "its scale", "1 : 1"),),
        lost=(Gap("fig. 1", "its colour", "black"), Gap("fig. 2", "all of it", "nothing")),
        listings=(Listing("Squares", ("name", "mm2"), lambda length_mm: [["a | b", f"{length_mm**2:.2f}"]]),),
        pictures=(Plot("fig. 1", "line", "A line", line),),
    )
    mistakes: Item[float] = Item(
        "Eq. 2",
        "its half",
        errata=(
            Erratum("eq. 2", "2 x", "x / 2", "a ruler", (
                Formula("half", "mm", lambda _: printed_mm, lambda length_mm: length_mm / 2,
                        lambda _: ours_mm / 2, "a ruler", 2),
            )),
            Erratum("eq. 3", "a", "b", "the text"),
        ),
    )  # fmt: skip
    return Paper("lab-scara", 'A. Author, "A length"', lambda _: ours_mm, (item, mistakes))


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
        assert refusal(capsys, "paper") == "ROBOT is missing: the robot whose paper it is"
        told = refusal(capsys, "paper", "lab-scra")
        assert told == "paper of robot 'lab-scra' is unknown: did you mean lab-scara?"
        told = refusal(capsys, "paper", "mine.toml")
        assert told == f"paper of robot 'mine.toml' is unknown: there are {', '.join(PAPERS)}"
        (file := tmp_path / "file").write_text("mine")
        assert refusal(capsys, "paper", "lab-scara", "--out", str(file)) == f"--out {file}: File exists"
        assert file.read_text() == "mine"


def test_every_robot_has_its_paper() -> None:
    assert set(PAPERS) == set(robot_names())
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
        assert not isinstance(picture, RunPicture) or picture.job in job_names(load_robot(robot))
    for item in paper.items:
        stated = [one.place for one in (*item.parts, *item.errata, *item.left_open, *item.lost, *item.pictures)]
        stated += [one.place for one in item.values if one.kind in {Basis.DIMENSION, Basis.RESULT}]
        for place in (*stated, item.place.lower()):
            assert PLACE.match(place), (item.place, place)
        for one in item.values:
            assert bool(one.place) is bool(one.source) is (one.kind in {Basis.DIMENSION, Basis.RESULT}), one.what
        assert all(part.why for part in item.parts if part.answer is not Coverage.YES)


@pytest.mark.parametrize("robot", PAPERS)
def test_each_number_of_a_paper_is_a_literal(robot: str) -> None:
    """What stands on the paper's side is written down, not computed: a number, or a parameter that is given one."""
    tree = ast.parse(Path(inspect.getfile(PAPERS[robot].study)).read_text(encoding="utf-8"))
    found = 0
    for call in ast.walk(tree):
        if isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id in {"dimension", "result"}:
            paper = call.args[3]
            number = paper.operand if isinstance(paper, ast.UnaryOp) else paper
            assert isinstance(number, ast.Constant) or (isinstance(number, ast.Name) and number.id == "paper")
            found += 1
    assert found


def test_the_items_of_the_papers_are_counted() -> None:
    """93 items were found in the five papers by a reader who went through them sentence by sentence."""
    assert sum(len(paper.parts) for paper in PAPERS.values()) == 93
    assert not [part for paper in PAPERS.values() for part in paper.parts if part.answer is Coverage.NO]
