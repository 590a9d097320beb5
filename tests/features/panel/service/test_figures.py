"""What the service makes of a served board's figures: how much of the time its clock stands."""

from steptwin.features.panel.service.history import EventLog
from steptwin.features.panel.service.service import ClockWatch
from steptwin.host.common.processes import ClockStood


def test_the_part_of_the_last_five_seconds_is_told() -> None:
    watch = ClockWatch(EventLog())
    told = [watch.percent(0.5 * i, ClockStood(i, 100.0 * i, 100.0)) for i in range(20)]
    assert told[0] == 0.0
    assert all(abs(percent - 20.0) < 1e-9 for percent in told[1:])
    later = [watch.percent(10.0 + 0.5 * i, ClockStood(19, 1900.0, 100.0)) for i in range(11)]
    assert later[-1] == 0.0
    assert later[4] > 0.0


def test_the_events_tell_of_it_as_the_terminal_does() -> None:
    events = EventLog()
    watch = ClockWatch(events)
    for i, total_ms in enumerate((0.0, 90.0, 120.0, 150.0, 250.0)):
        watch.percent(float(i), ClockStood(i, total_ms, 90.0))
    assert [(event.severity, event.text) for event in events.since()] == [
        ("warning", "computer too slow: the board's clock stood 2 times, 0.12 s in all, longest 90 ms"),
        ("warning", "computer too slow: the board's clock stood 4 times, 0.25 s in all, longest 90 ms"),
    ]


def test_another_board_begins_anew() -> None:
    watch = ClockWatch(EventLog())
    watch.percent(0.0, ClockStood(5, 5000.0, 90.0))
    assert watch.percent(1.0, ClockStood(0, 0.0, 0.0)) == 0.0
    assert watch.percent(2.0, ClockStood(1, 500.0, 500.0)) == 50.0
