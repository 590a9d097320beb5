"""Pictures of a run: made from a comparison of plan and evidence, never from the firmware's own view."""

from steptwin.host.record.plots.moment import Moment, View
from steptwin.host.record.plots.pictures import OF_AN_INSTANT, OF_EVERY_RUN, PICTURES, WHEREVER, write_plots

__all__ = ["OF_AN_INSTANT", "OF_EVERY_RUN", "PICTURES", "WHEREVER", "Moment", "View", "write_plots"]
