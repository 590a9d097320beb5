"""The further nodes on the bus of one emulated machine."""

from collections.abc import Mapping, Sequence
from typing import Any

from steptwin.emulator.simulation import Simulation
from steptwin.features.nodes.simple_node import SimpleNode
from steptwin.host.common.features import MachinePart
from steptwin.host.twin.machine.emulated_machine import EmulatedMachine


class NodesPart(MachinePart):
    """The further nodes of one machine.

    Attributes:
        nodes: the nodes by their ids.
    """

    def __init__(self, nodes: Mapping[int, SimpleNode]) -> None:
        self.nodes = nodes
        self._simulation: Simulation | None = None

    def join(self, simulation: Simulation) -> None:
        """Attach the nodes to the bus; each is a participant of its own."""
        self._simulation = simulation
        for node in self.nodes.values():
            simulation.bus.attach(node.can)
            simulation.join(node)

    def switched_on(self, _machine: EmulatedMachine) -> None:
        """Boot the nodes."""
        for node in self.nodes.values():
            node.boot(0)

    def switch(self, node_id: int, *, on: bool) -> None:
        """Switch the supply of a node off or on; a frame in transmission breaks off.

        Raises:
            KeyError: no node has this id.
        """
        node, simulation = self.nodes[node_id], self._simulation
        assert simulation is not None, "the machine is not switched on"
        if node.powered is on:
            return
        before = node.can
        (node.power_up if on else node.power_down)()
        simulation.bus.exchange(before, node.can, simulation.now_counts)
        if on:
            node.boot(simulation.now_counts)

    def described(self) -> Sequence[str]:
        """Return a line for each node."""
        return [f"further node 0x{node_id:02X}: {node.description.source}" for node_id, node in self.nodes.items()]

    def state(self) -> Mapping[str, Any]:
        """Return the NMT state of each node, by its id; OFF without supply."""
        states = {
            f"0x{node_id:02X}": node.nmt_state.name if node.powered else "OFF" for node_id, node in self.nodes.items()
        }
        return {"nodes": states}
