"""Find the least of ascending choices that passes, such as the smallest stretch of a motion that is too fast."""

from collections.abc import Callable


def least_passing(passes: Callable[[int], bool], fails: int, guess: int, largest: int) -> int | None:
    """Return the smallest number above `fails` that passes; None if none up to `largest` does.

    What passes is taken to pass for all larger numbers. Whether it does so or not, the number before the one returned
    is `fails` or has been tried and does not pass. A good guess, best from below, saves trials.
    """
    below, longer = fails, 1
    number = min(max(fails + 1, guess), largest)
    while not passes(number):
        if number >= largest:
            return None
        below, number, longer = number, min(number + longer, largest), 2 * longer
    if number - below > 1 and below == fails and not passes(number - 1):
        return number
    while number - below > 1:
        middle = (number + below) // 2
        if passes(middle):
            number = middle
        else:
            below = middle
    return number
