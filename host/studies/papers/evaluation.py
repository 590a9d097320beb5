"""Compute a paper: call every function of its items once and judge each number."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from math import isfinite
from typing import Any

from steptwin.host.studies.papers.paper import Basis, Computed, Erratum, Formula, Item, Paper, Rows, Value
from steptwin.host.studies.papers.study import Runs, Study


@dataclass(frozen=True, slots=True)
class Compared:
    """A value with ours computed; `agrees` is None if it stands alone."""

    value: Value
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
class Proof:
    """A misprinted formula with its numbers."""

    erratum: Erratum
    formula: Formula
    numbers: Computed

    @property
    def proven(self) -> bool:
        """Whether the corrected formula gives what it has to, and the printed one does not."""
        printed, corrected, truth = self.numbers
        within = self.formula.tolerance
        return abs(corrected - truth) <= within and not abs(printed - truth) <= within


@dataclass(frozen=True, slots=True)
class EvaluatedItem:
    """An item with everything computed but its pictures; `listings` holds the rows of each table."""

    item: Item
    values: tuple[Compared, ...]
    proofs: tuple[Proof, ...]
    listings: tuple[Rows, ...]


@dataclass(frozen=True, slots=True)
class EvaluatedPaper:
    """A paper with its items computed, and the study that its pictures are drawn from."""

    paper: Paper
    study: Study
    items: tuple[EvaluatedItem, ...]

    @property
    def values(self) -> tuple[Compared, ...]:
        """The values of all items."""
        return tuple(value for item in self.items for value in item.values)

    @property
    def proofs(self) -> tuple[Proof, ...]:
        """The computed formulas of all mistakes."""
        return tuple(proof for item in self.items for proof in item.proofs)

    @property
    def agrees(self) -> bool:
        """Whether every number that can be compared agrees, and every computed mistake is proven to be one."""
        return not any(self.disagreements)

    @property
    def disagreements(self) -> Iterator[str]:
        """A line for each number that does not agree and for each mistake that is not proven."""
        for item in self.items:
            for one in item.values:
                if one.agrees is False:
                    has = "has to be" if one.value.kind is Basis.CHECK else "the paper has"
                    yield f"{item.item.place}: {one.value.what}: {one.ours:.9g}, {has} {one.value.expected:g}"
            for proof in item.proofs:
                if not proof.proven:
                    printed, corrected, truth = proof.numbers
                    yield (
                        f"{proof.erratum.place}: {proof.formula.what}: {printed:.9g} as printed,"
                        f" {corrected:.9g} as corrected, {truth:.9g} is right"
                    )

    def to_dict(self) -> dict[str, Any]:
        """Return what `steptwin paper --json` prints; a number that does not exist is None."""
        return {
            "robot": self.paper.robot,
            "paper": self.paper.citation,
            "agrees": self.agrees,
            "items": [_item_document(item) for item in self.items],
        }


def evaluated(paper: Paper, runs: Runs) -> EvaluatedPaper:
    """Compute a paper; the runs that it needs are made, unless they have been before."""
    study = paper.study(runs)
    return EvaluatedPaper(paper, study, tuple(_item(item, study) for item in paper.items))


def _item(item: Item, study: Study) -> EvaluatedItem:
    return EvaluatedItem(
        item,
        tuple(Compared(value, float(value.ours(study))) for value in item.values),
        tuple(
            Proof(erratum, formula, Computed(*map(float, formula.compute(study))))
            for erratum in item.errata
            for formula in erratum.formulas
        ),
        tuple(listing.rows(study) for listing in item.listings),
    )


def _item_document(item: EvaluatedItem) -> dict[str, Any]:
    told = item.item
    return {
        "place": told.place,
        "title": told.title,
        "parts": [{**asdict(part), "why": part.why or None} for part in told.parts],
        "values": [_value_document(one) for one in item.values],
        "errata": [
            {
                **{key: getattr(erratum, key) for key in ("place", "printed", "right", "found")},
                "formulas": [_proof_document(proof) for proof in item.proofs if proof.erratum is erratum],
            }
            for erratum in told.errata
        ],
        "left_open": [asdict(gap) for gap in told.left_open],
        "lost": [asdict(gap) for gap in told.lost],
    }


def _value_document(one: Compared) -> dict[str, Any]:
    value = one.value
    return {
        **{key: getattr(value, key) for key in ("kind", "what", "unit")},
        "place": value.place or None,
        "paper": value.expected if value.place else None,
        "expected": value.expected,
        "source": value.source,
        "ours": _finite(one.ours),
        "difference": _finite(one.difference),
        "tolerance": value.tolerance,
        "agrees": one.agrees,
    }


def _proof_document(proof: Proof) -> dict[str, Any]:
    about = {key: getattr(proof.formula, key) for key in ("what", "unit", "truth_from")}
    numbers = {name: _finite(number) for name, number in proof.numbers._asdict().items()}
    return {**about, **numbers, "proven": proof.proven}


def _finite(number: float | None) -> float | None:
    return number if number is not None and isfinite(number) else None
