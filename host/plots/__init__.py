"""Pictures of a run: made from a comparison of plan and evidence, never from the firmware's own view."""

from host.plots.moment import Moment
from host.plots.pictures import OF_EVERY_RUN, PICTURES, write_plots

__all__ = ["OF_EVERY_RUN", "PICTURES", "Moment", "write_plots"]
