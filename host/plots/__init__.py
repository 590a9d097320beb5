"""Pictures of a run, as PNG files: made from a comparison of plan and evidence, never from the firmware's own view."""

from host.plots.pictures import PICTURES, write_plots

__all__ = ["PICTURES", "write_plots"]
