"""Common drivers, as data: the bare chip with its capacitor, the 3 A module, the slow blue board.

Figures marked [A] are assumed: sources give none, or only a range.
"""

from dataclasses import dataclass, replace
from typing import Final

from steptwin.emulator.drivers.driver_chip import Cooling
from steptwin.emulator.drivers.driver_module import ClkEdge, Coupler, Module, Requirements
from steptwin.emulator.drivers.tb6560.chip import Tb6560Kind
from steptwin.emulator.drivers.tb6560.dip_switches import switches_for


@dataclass(frozen=True, slots=True)
class DriverProfile:
    """A kind of driver at a board's axis connector, and its usual settings.

    Attributes:
        name: its name in robot files and on the command line.
        title: description in one line.
        module: the chip and the module around it, without its switches' positions.
        switched: True if the module has the switches of `tb6560.dip_switches`.
        current_a: usual phase current at full torque.
        idle_percent: usual current at standstill in percent of `current_a`, if the module has switches.
        fast_decay_percent: usual part of each chopping period with fast decay, if the module has switches.
    """

    name: str
    title: str
    module: Module
    switched: bool = False
    current_a: float = 1.5
    idle_percent: int = 50
    fast_decay_percent: int = 0

    def fitted(
        self,
        microsteps: int,
        current_a: float | None = None,
        active_edge: ClkEdge | None = None,
        *,
        idle_percent: int | None = None,
        fast_decay_percent: int | None = None,
    ) -> Module:
        """Return the module of one axis, set for its microstep mode; None takes the usual setting.

        Raises:
            ValueError: the switches have no such setting, or the module has no switches.
        """
        current_a = self.current_a if current_a is None else current_a
        idle = self.idle_percent if idle_percent is None else idle_percent
        fast_decay = self.fast_decay_percent if fast_decay_percent is None else fast_decay_percent
        if not self.switched and (idle_percent, fast_decay_percent) != (None, None):
            raise ValueError(f"{self.name} has no switches for its current at standstill and for its decay")
        return replace(
            self.module,
            switches=switches_for(current_a, microsteps, fast_decay, idle) if self.switched else None,
            sense_ohm=self.module.kind.sense_ohm(current_a),
            active_edge=active_edge or self.module.active_edge,
        )


def bare_chip(osc_pf: int) -> DriverProfile:
    """Return the profile of a chip on the board itself, with this OSC capacitor and wires alone."""
    return DriverProfile(
        f"chip-{osc_pf}pf", f"TB6560AHQ wired straight to the board, {osc_pf} pF at OSC", Module(Tb6560Kind(osc_pf))
    )


THREE_AMP_MODULE: Final = DriverProfile(
    name="3a-module",
    title='single-axis "3 A" module: 6N137 on STEP, PC817 on DIR and EN, own switches',
    module=Module(
        Tb6560Kind(330),
        # 6N137: 75 ns at most. PC817: 4 us at 100 ohm (Sharp), tens of us with the kilohms of these boards: [A] 24 us
        # to let go of its pull-up.
        clk=Coupler(to_high_ns=75, to_low_ns=75),
        direction=Coupler(to_high_ns=4_000, to_low_ns=24_000),
        enable=Coupler(to_high_ns=24_000, to_low_ns=4_000),
        enable_open=1,  # its EN light on means off, so it is on without a cable
        cooling=Cooling(resistance_k_per_w=8.0, capacity_j_per_k=40.0),  # [A] the heat sink of such a board
        source="3 A module: PC817 on DIR against 6N137 on STEP",
    ),
    switched=True,
)

SLOW_BLUE_BOARD: Final = DriverProfile(
    name="slow-blue-board",
    title="blue multi-axis board: 150 us for all four timings, steps with the falling edge",
    module=Module(
        Tb6560Kind(330),
        requirements=Requirements(150_000, 150_000, 150_000, 150_000),
        active_edge=ClkEdge.FALLING,
        cooling=Cooling(resistance_k_per_w=8.0, capacity_j_per_k=40.0),  # [A]
        source="LinuxCNC settings passed on for blue TB6560 boards: 150 us, falling edge",
    ),
)

PROFILES: Final = {
    profile.name: profile
    for profile in (bare_chip(100), bare_chip(330), bare_chip(1000), THREE_AMP_MODULE, SLOW_BLUE_BOARD)
}
"""Profiles by their names."""
