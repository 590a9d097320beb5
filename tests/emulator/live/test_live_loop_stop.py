"""The loop of a live board can be stopped at any time, also when it has ended."""

from tests.emulator.live.live_rig import LiveRig


def test_a_loop_that_has_ended_can_be_stopped_again() -> None:
    """A second Ctrl-C comes while the files are completed, when the loop's sockets are closed."""
    with LiveRig() as rig:
        rig.loop.stop()
    rig.loop.stop()
    rig.loop.wake()


def test_a_loop_that_nobody_reads_can_be_stopped_often() -> None:
    with LiveRig() as rig:
        rig.loop.stop()
        for _ in range(10_000):
            rig.loop.stop()
