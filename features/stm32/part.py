"""The image on one emulated machine: what tests and servers get of it."""

from collections.abc import Callable, Sequence

from steptwin.emulator.simulation import Participant, Simulation
from steptwin.features.stm32.firmware import ImageFirmware
from steptwin.features.stm32.tools import ImageTools
from steptwin.features.stm32.uart_ports import UartPorts
from steptwin.host.common.features import MachinePart
from steptwin.host.twin.machine.emulated_machine import EmulatedMachine

_LINES_SHOWN = 10


class ImagePart(MachinePart):
    """An image on one machine."""

    def __init__(self, uart_port: int | None) -> None:
        """Serve USART1 at a TCP port and a pseudo terminal; None: do not."""
        self._ports = None if uart_port is None else UartPorts(uart_port)
        self._machine: EmulatedMachine | None = None

    def join(self, simulation: Simulation) -> Participant | None:
        if self._ports is not None:
            self._ports.connect(lambda: _running(simulation))
        return self._ports

    def switched_on(self, machine: EmulatedMachine) -> None:
        self._machine = machine

    def tools(self, wait: Callable[[float], None]) -> ImageTools:
        """Return the running image for a test, whose time passes by `wait`."""
        assert self._machine is not None
        simulation = self._machine.simulation
        return ImageTools(
            lambda: _running(simulation), wait, lambda frame: simulation.host.send(frame, simulation.now_counts)
        )

    def described(self) -> Sequence[str]:
        return () if self._ports is None else self._ports.described()

    def close(self) -> None:
        if self._ports is not None:
            self._ports.close()

    def in_words(self) -> str:
        """Return the last lines that each USART has sent."""
        tools = self.tools(lambda _: None)
        return "\n".join(
            f"USART{number}: {line}"
            for number, usart in enumerate(tools.usarts, start=1)
            for line in usart.text.splitlines()[-_LINES_SHOWN:]
        )


def _running(simulation: Simulation) -> ImageFirmware:
    firmware = simulation.boards[0].running
    assert isinstance(firmware, ImageFirmware)
    return firmware
