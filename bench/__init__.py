"""Measure speed and timing error as ratios within one run; `python -m steptwin.bench` (`make bench`) prints all."""
