"""SDO block transfer by the canopen library's blocking client over the simulated bus."""

import canopen
from canopen.sdo.client import SdoClient

from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard


def test_a_block_goes_up_and_down(board: EmbeddedBoard) -> None:
    node = canopen.RemoteNode(0x12, canopen.ObjectDictionary())  # type: ignore[no-untyped-call]
    board.network.add_node(node)
    sdo: SdoClient = node.sdo
    with sdo.open(0x1008, 0, "rb", block_transfer=True) as stream:  # type: ignore[no-untyped-call]
        assert stream.read() == b"StepTwin stepper axis (SIMULATED)"
    with sdo.open(0x607C, 0, "wb", size=4, block_transfer=True) as stream:  # type: ignore[no-untyped-call]
        stream.write((-5).to_bytes(4, "little", signed=True))
    assert sdo.upload(0x607C, 0) == (-5).to_bytes(4, "little", signed=True)
