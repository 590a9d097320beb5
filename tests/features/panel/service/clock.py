"""A clock that tests set."""


class Clock:
    """Seconds on a clock, as `time.monotonic`."""

    def __init__(self) -> None:
        self.now_s = 100.0

    def __call__(self) -> float:
        return self.now_s
