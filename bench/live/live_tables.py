"""Print the live board's figures.

`python -m steptwin.bench.live.live_tables` streams for a minute and passes a million frames.
"""

from rich.console import Console
from rich.table import Table

from steptwin.bench.live import flood as live_flood
from steptwin.bench.live import round_trips as live
from steptwin.bench.live import streamed_points as live_stream
from steptwin.host.studies.step_methods.loads import AXES


def print_live(console: Console, *, stream_s: float, flood_frames: int) -> None:
    """Measure round trips, lateness, a stream to seven axes and a flood of frames; print each."""
    figures, stream = live.measure(), live_stream.measure(stream_s)
    table = Table("live board", "p50", "p99", "max", title="Real time at 1 Mbit/s: other processes as clients")
    trips_us = figures.round_trip_us_p50, figures.round_trip_us_p99, figures.round_trip_us_max
    table.add_row("SDO round trip, us", *(f"{trip_us:.0f}" for trip_us in trips_us))
    table.add_row("  x its time on the bus", *(f"{trip_us / figures.bus_us:.1f}" for trip_us in trips_us))
    for label, late in (
        ("ticks, six axes in profile velocity", figures.ticks),
        ("frames meanwhile", figures.frames),
        (f"ticks, {AXES} axes streaming", stream.ticks),
        ("frames meanwhile", stream.frames_late),
    ):
        row = (f"{late[f'late_us_{key}']:.0f}" for key in ("p50", "p99", "max"))
        table.add_row(f"lateness of {label}, us (of {late['count']})", *row)
    console.print(table)
    console.print(
        f"{AXES} axes, {stream.points} points at {1000 // live_stream.POINT_MS}/s each in {stream.seconds:g} s: "
        f"no underrun, {stream.queue_least} records in the emptiest queue; server {stream.server_cores:.0%} and "
        f"client {stream.client_cores:.0%} of a core; {stream.load_percent:.0f} % bus load"
    )
    flood = live_flood.measure(flood_frames)
    console.print(
        f"{flood.frames_per_s:.0f} frames/s from client to client, with a bus too fast to limit them; "
        f"the server's memory: "
        f"{flood.memory_mb_early:.1f} MB after {flood.frames // 10} frames, "
        f"{flood.memory_mb_late:.1f} MB after {flood.frames}"
    )


if __name__ == "__main__":
    print_live(Console(highlight=False, width=110), stream_s=60.0, flood_frames=1_000_000)
