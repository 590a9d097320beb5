"""One example of a property: the property itself, with many examples, is marked `slow`."""

import warnings
from collections.abc import Callable

from hypothesis.errors import HypothesisDeprecationWarning


def one_example(test: Callable[..., None], *arguments: object, **inputs: object) -> None:
    """Run the body of a Hypothesis test with one input, which must meet what it assumes."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", HypothesisDeprecationWarning)  # of `assume` outside Hypothesis
        test.hypothesis.inner_test(*arguments, **inputs)  # type: ignore[attr-defined]
