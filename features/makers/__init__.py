"""Machines of makers: robot files made of the configurations of Klipper, grbl, grblHAL, Marlin and LinuxCNC."""

from typing import TYPE_CHECKING, Final

from steptwin.host.common.features import Feature

if TYPE_CHECKING:
    from steptwin.features.makers.options import ConfigurationOptions


def _new_options() -> "type[ConfigurationOptions]":
    from steptwin.features.makers.options import ConfigurationOptions

    return ConfigurationOptions


FEATURE: Final = Feature(name="makers", new_options=_new_options)
