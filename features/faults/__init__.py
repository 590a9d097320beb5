"""Faults on purpose: what may go wrong, what starts it, and whether the machine answers as documented."""

from typing import Final

from steptwin.host.common.features import COMMAND_GROUPS, CommandRow, Feature

FEATURE: Final = Feature(
    name="faults",
    commands=(
        CommandRow(
            "inject",
            COMMAND_GROUPS[2],
            "Harm a served board: e-stop, supply, sensors, switches, wires, drivers, motors, payload, logic and bus.",
            "steptwin.features.faults.inject",
        ),
    ),
)
