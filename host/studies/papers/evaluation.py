"""Compute a paper: call every function of its items once and judge each number."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import isfinite
from typing import Any

from steptwin.host.studies.papers.paper import Basis, Erratum, Formula, Gap, Item, Paper, Value
from steptwin.host.studies.papers.runs import Runs


@dataclass(frozen=True, slots=True)
class Compared:
    """A value with ours computed; `agrees` is None if it stands alone."""

    value: Value[Any]
    ours: float

    @property
    def difference(self) -> float | None:
        """Ours minus what it has to be; None if it stands alone."""
        return None if self.value.expected is None else self.ours - self.value.expected

    @property
    def agrees(self) -> bool | None:
        """Whether the difference is within the tolerance; None if the number stands alone."""
        return None if self.difference is None else abs(self.difference) <= self.value.tolerance


@dataclass(frozen=True, slots=True)
class Computed:
    """A misprinted formula with its three numbers."""

    formula: Formula[Any]
    printed: float
    corrected: float
    truth: float

    @property
    def proven(self) -> bool:
        """Whether the corrected formula gives what it has to, and the printed one does not."""
        within = self.formula.tolerance
        return abs(self.corrected - self.truth) <= within and not abs(self.printed - self.truth) <= within


@dataclass(frozen=True, slots=True)
class EvaluatedErratum:
    """A mistake with its formulas computed."""

    erratum: Erratum[Any]
    formulas: tuple[Computed, ...]


@dataclass(frozen=True, slots=True)
class EvaluatedItem:
    """An item with everything computed but its pictures; `listings` holds the rows of each table."""

    item: Item[Any]
    values: tuple[Compared, ...]
    errata: tuple[EvaluatedErratum, ...]
    listings: tuple[list[list[str]], ...]


@dataclass(frozen=True, slots=True)
class EvaluatedPaper:
    """A paper with its items computed, and the study that its pictures are drawn from."""

    paper: Paper[Any]
    study: Any
    items: tuple[EvaluatedItem, ...]

    @property
    def values(self) -> tuple[Compared, ...]:
        """The values of all items."""
        return tuple(value for item in self.items for value in item.values)

    @property
    def formulas(self) -> tuple[Computed, ...]:
        """The computed formulas of all mistakes."""
        return tuple(formula for item in self.items for erratum in item.errata for formula in erratum.formulas)

    @property
    def agrees(self) -> bool:
        """Whether every number that can be compared agrees, and every computed mistake is proven to be one."""
        return all(value.agrees is not False for value in self.values) and all(one.proven for one in self.formulas)

    @property
    def disagreements(self) -> Iterator[str]:
        """A line for each number that does not agree and for each mistake that is not proven."""
        for item in self.items:
            for value in item.values:
                if value.agrees is False:
                    what = f"{item.item.place}: {value.value.what}"
                    has = "has to be" if value.value.kind is Basis.CHECK else "the paper has"
                    yield f"{what}: {value.ours:.9g}, {has} {value.value.expected:g}"
            for erratum in item.errata:
                for one in erratum.formulas:
                    if not one.proven:
                        yield (
                            f"{erratum.erratum.place}: {one.formula.what}: {one.printed:.9g} as printed,"
                            f" {one.corrected:.9g} as corrected, {one.truth:.9g} is right"
                        )

    def to_dict(self) -> dict[str, Any]:
        """Return what `steptwin paper --json` prints; a number that does not exist is None."""
        return {
            "robot": self.paper.robot,
            "paper": self.paper.citation,
            "agrees": self.agrees,
            "items": [_item_document(item) for item in self.items],
        }


def evaluated(paper: Paper[Any], runs: Runs) -> EvaluatedPaper:
    """Compute a paper; the runs that it needs are made, unless they have been before."""
    study = paper.study(runs)
    return EvaluatedPaper(paper, study, tuple(_item(item, study) for item in paper.items))


def _item(item: Item[Any], study: Any) -> EvaluatedItem:
    return EvaluatedItem(
        item,
        tuple(Compared(value, float(value.ours(study))) for value in item.values),
        tuple(_erratum(erratum, study) for erratum in item.errata),
        tuple(listing.rows(study) for listing in item.listings),
    )


def _erratum(erratum: Erratum[Any], study: Any) -> EvaluatedErratum:
    computed = (
        Computed(formula, *(float(compute(study)) for compute in (formula.printed, formula.corrected, formula.truth)))
        for formula in erratum.formulas
    )
    return EvaluatedErratum(erratum, tuple(computed))


def _item_document(item: EvaluatedItem) -> dict[str, Any]:
    return {
        "place": item.item.place,
        "title": item.item.title,
        "parts": [
            {"place": part.place, "what": part.what, "how": part.how, "answer": part.answer, "why": part.why or None}
            for part in item.item.parts
        ],
        "values": [
            {
                "kind": one.value.kind,
                "what": one.value.what,
                "unit": one.value.unit,
                "place": one.value.place or None,
                "paper": one.value.expected if one.value.place else None,
                "expected": one.value.expected,
                "source": one.value.source or None,
                "ours": _finite(one.ours),
                "difference": _finite(one.difference),
                "tolerance": one.value.tolerance,
                "agrees": one.agrees,
            }
            for one in item.values
        ],
        "errata": [
            {
                "place": one.erratum.place,
                "printed": one.erratum.printed,
                "right": one.erratum.right,
                "found": one.erratum.found,
                "formulas": [_formula_document(formula) for formula in one.formulas],
            }
            for one in item.errata
        ],
        "left_open": [_gap_document(gap) for gap in item.item.left_open],
        "lost": [_gap_document(gap) for gap in item.item.lost],
    }


def _gap_document(gap: Gap) -> dict[str, str]:
    return {"place": gap.place, "what": gap.what, "instead": gap.instead}


def _formula_document(one: Computed) -> dict[str, Any]:
    numbers = {"printed": one.printed, "corrected": one.corrected, "truth": one.truth}
    about = {"what": one.formula.what, "unit": one.formula.unit, "truth_from": one.formula.truth_from}
    return about | {name: _finite(number) for name, number in numbers.items()} | {"proven": one.proven}


def _finite(number: float | None) -> float | None:
    return number if number is not None and isfinite(number) else None
