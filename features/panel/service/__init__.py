"""The machine service: one machine on one bus; any number of pages watch it, and one of them operates it.

Requests and states flow one way each, and meet in one thread:

- A page sends a request with the number of the newest state that it had shown. `service.py: MachineService` checks it
  in the page's thread by the guards of `guards.py`: who operates, how old that state is, what has voided it since.
- One accepted command, one held button and one stop wait for the service's thread. That thread alone owns bus and
  session (`connected.py`): it makes a stop first, then performs a command of `commands.py`, or jogs.
- In each of its waits it publishes an immutable, numbered `snapshots.py: Snapshot` of the axes' reports
  (`telemetry.py`). Pages read it, with the events and curves of `history.py`, `results.py` and `settings.py`.
- A stop is never too old: it comes from any page at any time, and its quick stop is sent from the page's own thread.

Nothing here depends on pages.
"""
