"""Draw pictures of a run from a comparison of plan and evidence, never from the firmware's own view."""

from steptwin.host.record.plots.canvas import PlotMoment, PlotView
from steptwin.host.record.plots.pictures import CLOSE_UPS, DEFAULT_PICTURES, DEFAULT_VIEW, PICTURES, write_plots

__all__ = ["CLOSE_UPS", "DEFAULT_PICTURES", "DEFAULT_VIEW", "PICTURES", "PlotMoment", "PlotView", "write_plots"]
