"""Gather what is wrong with the steps of a program, once for each step, however often a repetition makes it."""

from collections import Counter
from collections.abc import Iterator

from steptwin.host.common.errors import InputError
from steptwin.host.planning.programs.steps import Step
from steptwin.host.planning.programs.writing_out import Place


class Complaints:
    """What is wrong with the steps of a program, by their numbers, in the order in which they are made."""

    def __init__(self) -> None:
        self._judged: Counter[str] = Counter()
        """How many times a step was judged."""
        self._wrong: dict[str, dict[Place, list[str]]] = {}
        """What is wrong with a step, at each place that has its number."""
        self._texts: dict[str, str] = {}

    def __bool__(self) -> bool:
        return bool(self._wrong)

    def judge(self, place: Place) -> None:
        """Note that a step is judged once more."""
        self._judged[place.number] += 1

    def add(self, place: Place, step: Step, error: InputError) -> None:
        """Add what is wrong with a step."""
        self._wrong.setdefault(place.number, {}).setdefault(place, []).extend(error.messages)
        self._texts[place.number] = str(step)

    def messages(self) -> Iterator[str]:
        """Yield the messages of the first pass of each step; later ones only repeat them."""
        for number, wrong in self._wrong.items():
            first, messages = next(iter(wrong.items()))
            where = pass_words(first, len(wrong), self._judged[number])
            for message in messages:
                yield f"step {number} ({self._texts[number]}{where}): {message}"


def pass_words(first: Place, wrong: int, judged: int) -> str:
    """Return the passes in which a step is wrong: `, in every pass`, the first one, or nothing without repetition."""
    if not first.passes:
        return ""
    return ", in every pass" if judged > 1 and wrong == judged else f", in pass {first.pass_text}"
