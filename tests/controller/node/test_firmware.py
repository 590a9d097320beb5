"""The firmware as a whole: its reactions to frames and its own frames, each at the right instant."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.controller.motion.backend import Kernel, python_kernel
from steptwin.controller.node.firmware import Firmware
from steptwin.controller.node.pins import OUTPUT_PINS, Pin, PinChange
from steptwin.protocol import od
from steptwin.protocol.cia402 import AbortConnection, DigitalOutput, ErrorCode, Mode, State
from steptwin.protocol.frame import Frame
from steptwin.protocol.nmt import NmtState
from steptwin.protocol.pvt import PvtFlag
from steptwin.protocol.sdo_frames import AbortCode
from tests.controller.bench_board import BenchBoard
from tests.controller.units import MS, STEP
from tests.messages import refusing


class TestBoot:
    def test_every_node_announces_itself_and_waits(self, fast_kernel: Kernel) -> None:
        board = BenchBoard(fast_kernel, axes=8)
        assert [frame for _, frame in board.sent] == [Frame(0x710 + i, b"\0") for i in range(8)]
        assert all(node.nmt_state is NmtState.PRE_OPERATIONAL for node in board.firmware.nodes)
        assert all(node.drive.state is State.SWITCH_ON_DISABLED for node in board.firmware.nodes)

    @pytest.mark.parametrize("node", [0, 0x10])
    @pytest.mark.parametrize("ms_after", [0.1, 0.4, 0.9, 1.2])
    def test_a_reset_lets_a_long_pulse_end(self, board: BenchBoard, node: int, ms_after: float) -> None:
        """The pulse of 1 ms has been placed with a setting that the reset takes back to 33 us."""
        board.write(od.STEPLEN_NS, 1_000_000)
        board.write(od.ABORT_CONNECTION_OPTION, AbortConnection.DISABLE_VOLTAGE)
        board.enable(Mode.PROFILE_VELOCITY)
        board.write(od.TARGET_VELOCITY, 100 * STEP)
        board.firmware.motion.take_edges()
        clk: list[int] = []
        while not clk:
            board.wait(0.25)
            clk = [int(counts) for counts in board.firmware.motion.take_edges()[0].clk_counts]
        rise, fall = clk
        assert fall - rise == 1000 * 72
        board.firmware.take_pins()
        board.wait(max(0.0, rise / MS + ms_after - board.now / MS))
        board.nmt(0x81, node)
        (change,) = [change for change in board.firmware.take_pins() if change.pin is Pin.ENABLE]
        assert (change.level, change.counts) == (0, max(fall, board.now))

    @pytest.mark.parametrize("axes", [0, 9])
    def test_a_board_has_one_to_eight_axes(self, fast_kernel: Kernel, axes: int) -> None:
        with refusing(ValueError):
            Firmware(fast_kernel, axes)

    def test_drivers_leave_reset_at_power_up_and_are_enabled_with_the_drive(self, board: BenchBoard) -> None:
        board.wait(1)
        board.enable()
        board.write(od.CONTROLWORD, 0)
        changes = [(change.pin, change.level) for change in board.firmware.take_pins()]
        assert changes == [(Pin.M2, 1), (Pin.RESET, 1), (Pin.ENABLE, 1), (Pin.ENABLE, 0)]


class TestNetwork:
    def test_stopped_nodes_answer_nothing_but_nmt(self, board: BenchBoard) -> None:
        board.nmt(2)
        board.send(0x610, bytes.fromhex("4000100000000000"))
        assert board.frames(0x590) == []
        board.nmt(0x80)
        board.send(0x610, bytes.fromhex("4000100000000000"))
        assert len(board.frames(0x590)) == 1

    def test_process_data_is_taken_in_operational_only(self, board: BenchBoard) -> None:
        board.send(0x210, b"\x06\x00\x07")
        assert board.value(od.CONTROLWORD) == 0
        board.nmt(1)
        board.send(0x210, b"\x06\x00\x07")
        assert (board.value(od.CONTROLWORD), board.value(od.MODE_OF_OPERATION_DISPLAY)) == (6, 7)
        assert board.state() is State.READY_TO_SWITCH_ON

    def test_heartbeat(self, board: BenchBoard) -> None:
        board.write(od.PRODUCER_HEARTBEAT_TIME, 100)
        board.wait(350)
        board.nmt(1)
        board.wait(100)
        assert [data[0] for data in board.frames(0x710)] == [0, 127, 127, 127, 127, 5]

    def test_reset_communication_restores_the_profile_area_only(self, board: BenchBoard) -> None:
        board.write(od.PRODUCER_HEARTBEAT_TIME, 100)
        board.write(od.HOME_OFFSET, 5)
        board.nmt(0x82)
        assert (board.value(od.PRODUCER_HEARTBEAT_TIME), board.value(od.HOME_OFFSET)) == (0, 5)
        assert board.frames(0x710)[-1] == b"\0"

    def test_reset_communication_drops_emergencies_that_wait(self, board: BenchBoard) -> None:
        board.write(od.EMCY_INHIBIT_TIME, 10_000)  # one EMCY a second
        board.nmt(1)
        for _ in range(3):
            board.send(0x510, b"")
        board.nmt(0x82)
        board.wait(3000)
        assert board.emergencies() == [ErrorCode.PDO_TOO_SHORT]

    def test_reset_node_forgets_every_error(self, board: BenchBoard) -> None:
        board.write(od.EMCY_INHIBIT_TIME, 10_000)
        board.enable()
        board.record(40 * STEP, 64 * STEP, 10, 0)
        board.start()
        board.wait(500)
        board.send(0x510, b"")
        assert board.state() is State.FAULT
        board.nmt(0x81)
        assert board.state() is State.SWITCH_ON_DISABLED
        assert [board.value(address) for address in (od.ERROR_REGISTER, od.ERROR_HISTORY_COUNT, od.ERROR_CODE)] == [
            0
        ] * 3
        before = len(board.emergencies())
        board.wait(3000)
        assert len(board.emergencies()) == before

    def test_reset_node_restores_all_and_switches_off(self, board: BenchBoard) -> None:
        board.enable()
        board.write(od.HOME_OFFSET, 5)
        board.nmt(0x81)
        assert board.state() is State.SWITCH_ON_DISABLED
        assert (board.value(od.HOME_OFFSET), board.value(od.MODE_OF_OPERATION_DISPLAY)) == (0, 0)

    def test_statusword_is_reported_when_it_changes_and_every_100_ms(self, board: BenchBoard) -> None:
        board.nmt(1)
        board.wait(250)
        times = [round(t / MS) for t, frame in board.sent if frame.cob_id == 0x190]
        assert times == [0, 100, 200]
        board.wait(10)
        board.write(od.CONTROLWORD, 0x06)
        assert State.of(int.from_bytes(board.frames(0x190)[-1][:2], "little")) is State.READY_TO_SWITCH_ON

    def test_a_remapped_rpdo_is_listened_to_at_its_new_cob_id(self, board: BenchBoard) -> None:
        board.write(od.address_of(od.RPDO_COMMUNICATION[0], od.PDO_COB_ID), 1 << 31 | 0x210)
        board.write(od.address_of(od.RPDO_COMMUNICATION[0], od.PDO_COB_ID), 0x2A0)
        board.nmt(1)
        board.send(0x210, b"\x06\x00\x07")
        assert board.value(od.CONTROLWORD) == 0
        board.send(0x2A0, b"\x06\x00\x07")
        assert board.value(od.CONTROLWORD) == 6

    def test_a_short_pdo_is_reported(self, board: BenchBoard) -> None:
        board.nmt(1)
        board.send(0x510, bytes(7))
        assert board.frames(0x090) == [bytes.fromhex("1082 11 0400000000")]
        assert board.value(od.ERROR_HISTORY[0]) == ErrorCode.PDO_TOO_SHORT

    def test_a_pdo_of_the_right_length_ends_the_error_of_its_number(self, board: BenchBoard) -> None:
        board.nmt(1)
        for cob_id, data in ((0x510, bytes(7)), (0x510, bytes(7)), (0x210, bytes(2)), (0x210, bytes(4))):
            board.send(cob_id, data)
        assert board.emergencies() == [0x8210, 0x8210, 0x8220]
        board.send(0x210, bytes(3))
        assert (board.emergencies()[3:], board.value(od.ERROR_REGISTER)) == ([0], 0x11)
        board.record(0, 0, 10, 0)
        assert (board.emergencies()[4:], board.value(od.ERROR_REGISTER)) == ([0], 0)

    def test_a_sync_of_the_wrong_length_does_nothing_and_is_reported(self, board: BenchBoard) -> None:
        board.nmt(1)
        board.send(0x310, b"\x06\x00")
        board.send(0x080, b"\x01")
        assert (board.value(od.CONTROLWORD), board.frames(0x090)) == (0, [bytes.fromhex("4082 11 0100000000")])
        board.send(0x080, b"")
        assert (board.value(od.CONTROLWORD), board.emergencies()) == (6, [0x8240, 0])

    def test_sync_with_a_counter(self, board: BenchBoard) -> None:
        board.write(od.SYNC_COUNTER_OVERFLOW, 4)
        board.write(od.address_of(od.TPDO_COMMUNICATION[1], od.PDO_SYNC_START), 3)
        board.write(od.address_of(od.TPDO_COMMUNICATION[1], od.PDO_COB_ID), 0x290)
        board.nmt(1)
        board.send(0x080, b"")
        assert board.emergencies() == [0x8240]
        for counter in (1, 2, 3, 4, 1):
            board.send(0x080, bytes((counter,)))
        assert len(board.frames(0x290)) == 3

    def test_the_emergency_identifier_may_be_changed_and_switched_off(self, board: BenchBoard) -> None:
        board.nmt(1)
        assert board.write(od.EMCY_COB_ID, 0x0A0) == AbortCode.VALUE_RANGE
        assert board.write(od.EMCY_COB_ID, 1 << 31 | 0x090) == 0
        board.send(0x510, bytes(7))
        board.wait(1)
        assert (board.emergencies(), board.value(od.ERROR_REGISTER)) == ([], 0x11)
        for refused in (1 << 30 | 0x090, 1 << 29 | 0x090, 0x800, 0x710):
            assert board.write(od.EMCY_COB_ID, refused) == AbortCode.VALUE_RANGE
        assert board.write(od.EMCY_COB_ID, 0x0A0) == 0
        board.record(0, 0, 10, 0)
        assert board.frames(0x0A0) == [bytes(8)]

    @pytest.mark.slow
    @given(st.lists(st.tuples(st.integers(0, 0x7FF), st.binary(max_size=8)), max_size=30))
    def test_junk_never_raises(self, frames: list[tuple[int, bytes]]) -> None:
        board = BenchBoard(python_kernel(), axes=2)
        board.enable()
        for cob_id, data in frames:
            board.send(cob_id, data)
            board.wait(0.3)
        assert board.firmware.dropped_frames <= len(frames)


class TestConfiguration:
    @pytest.mark.parametrize("microsteps", [1, 2, 4, 5, 8, 10, 16, 20, 25, 32, 40, 50, 64, 100, 125, 128])
    def test_microstep_settings_of_drivers(self, board: BenchBoard, microsteps: int) -> None:
        assert board.write(od.MICROSTEPS, microsteps) == 0
        assert board.firmware.motion.axes[0].config.microsteps == microsteps
        assert (board.value(od.MICROSTEPS), board.value(od.MICROSTEPS_WORD)) == (microsteps, microsteps)

    def test_256_microsteps_are_set_by_a_word(self, board: BenchBoard) -> None:
        """A byte shows 255 for them, which cannot be written; after them a byte counts again, and so does a word."""
        assert board.write(od.MICROSTEPS_WORD, 256) == 0
        assert board.firmware.motion.axes[0].config.microsteps == 256
        assert (board.value(od.MICROSTEPS), board.value(od.MICROSTEPS_WORD)) == (255, 256)
        assert board.write(od.MICROSTEPS, 255) == AbortCode.VALUE_TOO_HIGH
        for address, microsteps in ((od.MICROSTEPS, 8), (od.MICROSTEPS_WORD, 256), (od.MICROSTEPS_WORD, 32)):
            assert board.write(address, microsteps) == 0
            assert board.firmware.motion.axes[0].config.microsteps == board.value(od.MICROSTEPS_WORD) == microsteps
        assert board.value(od.MICROSTEPS) == 32

    @pytest.mark.parametrize("microsteps", [3, 15, 126])
    @pytest.mark.parametrize("address", [od.MICROSTEPS, od.MICROSTEPS_WORD])
    def test_settings_that_no_driver_has(self, board: BenchBoard, microsteps: int, address: int) -> None:
        assert board.write(address, microsteps) == AbortCode.VALUE_RANGE

    @pytest.mark.parametrize(
        ("address", "value", "refused"),
        [
            (od.MICROSTEPS, 0, AbortCode.VALUE_TOO_LOW),
            (od.MICROSTEPS, 129, AbortCode.VALUE_TOO_HIGH),
            (od.MICROSTEPS_WORD, 0, AbortCode.VALUE_TOO_LOW),
            (od.MICROSTEPS_WORD, 257, AbortCode.VALUE_TOO_HIGH),
        ],
    )
    def test_microsteps_out_of_range(self, board: BenchBoard, address: int, value: int, refused: AbortCode) -> None:
        assert board.write(address, value) == refused

    @pytest.mark.parametrize(
        ("address", "value"),
        [(od.MAX_PROFILE_VELOCITY, 1), (od.STEPLEN_NS, 500_000), (od.DIRHOLD_NS, 0), (od.MICROSTEPS, 8)],
    )
    def test_new_limits_drop_the_records_that_wait(self, board: BenchBoard, address: int, value: int) -> None:
        """The room for edges follows the new limits: records accepted within the old ones would not fit."""
        board.nmt(1)
        board.record(75 * 10 * STEP, 15 * STEP * 64, 100, 0)
        board.record(15 * 250 * STEP, 15 * STEP * 64, 250, 1)
        assert board.write(address, value) == 0
        assert (board.value(od.BUFFER_POSITION), board.value(od.PVT_FREE_RECORDS), board.flags()) == (
            0,
            0,
            PvtFlag.EMPTY,
        )
        board.record(0, 0, 10, 2)  # records 0 and 1 are gone: the one after them must not move the axis either
        assert (board.value(od.BUFFER_POSITION), board.value(od.PVT_NEXT_SEQUENCE)) == (0, 2)
        assert board.write(od.BUFFER_CLEAR, 0) == 0
        board.record(0, 0, 10, 0)
        assert board.value(od.BUFFER_POSITION) == 1

    def test_an_empty_queue_stays_open_for_new_limits(self, board: BenchBoard) -> None:
        assert board.write(od.MAX_PROFILE_VELOCITY, 1_000_000) == 0
        assert board.value(od.PVT_FREE_RECORDS) == 64

    def test_steps_are_not_reconfigured_while_the_driver_is_on(self, board: BenchBoard) -> None:
        board.enable()
        assert board.write(od.MICROSTEPS, 8) == AbortCode.DEVICE_STATE
        assert board.write(od.STEPLEN_NS, 40_000) == AbortCode.DEVICE_STATE

    def test_modes_that_do_not_exist(self, board: BenchBoard) -> None:
        assert board.write(od.MODE_OF_OPERATION, 4) == AbortCode.VALUE_RANGE
        assert board.value(od.MODE_OF_OPERATION_DISPLAY) == 0


class TestOutputs:
    OUT1, OUT2 = int(DigitalOutput.OUT1), int(DigitalOutput.OUT2)
    BOTH = OUT1 | OUT2

    def changes(self, board: BenchBoard) -> list[PinChange]:
        return [change for change in board.firmware.take_pins() if change.pin in OUTPUT_PINS]

    def switched(self, board: BenchBoard) -> list[tuple[Pin, int]]:
        return [(change.pin, change.level) for change in self.changes(board)]

    def map_into_rpdo3(self, board: BenchBoard, transmission: int) -> None:
        writes = [
            (od.address_of(od.RPDO_COMMUNICATION[2], od.PDO_COB_ID), 1 << 31 | 0x410),
            (od.address_of(od.RPDO_MAPPING[2], 0), 0),
            (od.address_of(od.RPDO_MAPPING[2], 1), 0x60FE_0120),
            (od.address_of(od.RPDO_MAPPING[2], 0), 1),
        ]
        for address, value in [
            *writes,
            (od.address_of(od.RPDO_COMMUNICATION[2], od.PDO_TRANSMISSION_TYPE), transmission),
            (od.address_of(od.RPDO_COMMUNICATION[2], od.PDO_COB_ID), 0x410),
        ]:
            assert board.write(address, value) == 0

    def test_outputs_are_off_after_power_up(self, pair: BenchBoard) -> None:
        assert (pair.value(od.DIGITAL_OUTPUTS), pair.value(od.DIGITAL_OUTPUTS_MASK)) == (0, self.BOTH)
        assert self.changes(pair) == []

    def test_each_output_follows_its_bit_in_the_instant_of_the_frame(self, pair: BenchBoard) -> None:
        expected = []
        for value, pin, level in ((1 << 17, Pin.OUT2, 1), (3 << 16, Pin.OUT1, 1), (1 << 16, Pin.OUT2, 0)):
            pair.wait(1.23)
            assert pair.write(od.DIGITAL_OUTPUTS, value, axis=1) == 0
            expected.append(PinChange(pair.now, 1, pin, level))
        assert self.changes(pair) == expected

    def test_a_level_that_stays_is_no_change(self, board: BenchBoard) -> None:
        for value in (0, self.OUT1, self.OUT1, self.BOTH, self.BOTH):
            board.write(od.DIGITAL_OUTPUTS, value)
        assert self.switched(board) == [(Pin.OUT1, 1), (Pin.OUT2, 1)]

    def test_an_output_is_off_where_its_mask_is_0(self, board: BenchBoard) -> None:
        board.write(od.DIGITAL_OUTPUTS_MASK, self.OUT1)
        board.write(od.DIGITAL_OUTPUTS, self.BOTH)
        assert self.switched(board) == [(Pin.OUT1, 1)]
        board.write(od.DIGITAL_OUTPUTS_MASK, self.OUT2)
        assert self.switched(board) == [(Pin.OUT1, 0), (Pin.OUT2, 1)]
        board.write(od.DIGITAL_OUTPUTS_MASK, 0)
        assert self.switched(board) == [(Pin.OUT2, 0)]
        assert board.value(od.DIGITAL_OUTPUTS) == self.BOTH

    @pytest.mark.parametrize(
        ("address", "other"),
        [(od.DIGITAL_OUTPUTS, od.DIGITAL_OUTPUTS_MASK), (od.DIGITAL_OUTPUTS_MASK, od.DIGITAL_OUTPUTS)],
    )
    def test_bits_without_an_output_are_stored_and_do_nothing(
        self, board: BenchBoard, address: int, other: int
    ) -> None:
        board.write(other, 0xFFFF_FFFF)
        self.changes(board)
        for value in (0xFFFC_FFFF | self.OUT1, self.OUT1, 0x0000_FFFF | self.OUT1):
            assert board.write(address, value) == 0
            assert board.value(address) == value
        assert self.switched(board) == ([(Pin.OUT1, 1)] if address == od.DIGITAL_OUTPUTS else [(Pin.OUT2, 0)])

    def test_a_pdo_switches_at_once(self, board: BenchBoard) -> None:
        self.map_into_rpdo3(board, transmission=255)
        board.send(0x410, self.BOTH.to_bytes(4, "little"))
        assert self.changes(board) == []
        board.nmt(1)
        board.wait(2.5)
        board.send(0x410, self.BOTH.to_bytes(4, "little"))
        assert self.changes(board) == [PinChange(board.now, 0, pin, 1) for pin in OUTPUT_PINS]

    def test_a_synchronous_pdo_switches_with_sync(self, board: BenchBoard) -> None:
        self.map_into_rpdo3(board, transmission=1)
        board.nmt(1)
        board.send(0x410, self.OUT2.to_bytes(4, "little"))
        board.wait(2.5)
        assert self.changes(board) == []
        board.send(0x080, b"")
        assert self.changes(board) == [PinChange(board.now, 0, Pin.OUT2, 1)]

    def test_drive_states_and_faults_leave_outputs_as_they_are(self, board: BenchBoard) -> None:
        """A gripper must hold its load while the drive starts, stops, fails and recovers."""
        board.write(od.DIGITAL_OUTPUTS, self.BOTH)
        self.changes(board)
        board.enable()
        board.record(20 * STEP, 64 * STEP, 20, 0)
        board.start()
        board.wait(21)
        assert board.state() is State.FAULT_REACTION_ACTIVE
        board.wait(1000)
        assert board.state() is State.FAULT
        board.write(od.CONTROLWORD, 0x80)
        board.enable()
        for word in (0x02, 0x06, 0x00):
            board.write(od.CONTROLWORD, word)
        assert board.state() is State.SWITCH_ON_DISABLED
        assert self.changes(board) == []

    @pytest.mark.parametrize("command", [0x01, 0x02, 0x80, 0x82])
    def test_network_states_and_reset_communication_leave_outputs_as_they_are(
        self, board: BenchBoard, command: int
    ) -> None:
        board.write(od.DIGITAL_OUTPUTS, self.OUT1)
        self.changes(board)
        board.nmt(command)
        assert self.changes(board) == []
        assert board.value(od.DIGITAL_OUTPUTS) == self.OUT1

    def test_reset_node_switches_off_the_outputs_of_that_node(self, pair: BenchBoard) -> None:
        for axis in (0, 1):
            pair.write(od.DIGITAL_OUTPUTS_MASK, self.OUT2, axis)
            pair.write(od.DIGITAL_OUTPUTS, self.BOTH, axis)
        self.changes(pair)
        pair.wait(3)
        pair.nmt(0x81, node=0x11)
        assert self.changes(pair) == [PinChange(pair.now, 1, Pin.OUT2, 0)]
        assert (pair.value(od.DIGITAL_OUTPUTS, axis=1), pair.value(od.DIGITAL_OUTPUTS_MASK, axis=1)) == (0, self.BOTH)

    def test_boot_switches_outputs_off(self, board: BenchBoard) -> None:
        board.write(od.DIGITAL_OUTPUTS, self.OUT1)
        board.firmware.boot(board.now)
        assert self.switched(board) == [(Pin.OUT1, 1), (Pin.OUT1, 0)]
