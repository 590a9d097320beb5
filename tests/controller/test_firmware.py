"""The firmware as a whole: its reactions to frames and its own frames, each at the right instant."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.controller.motion.backend import Kernel, python_kernel
from steptwin.controller.node.firmware import Firmware
from steptwin.controller.node.pins import OUTPUT_PINS, Pin, PinChange
from steptwin.protocol import od
from steptwin.protocol.abort import AbortCode
from steptwin.protocol.cia402 import AbortConnection, DigitalOutput, ErrorCode, Mode, State
from steptwin.protocol.frame import Frame
from steptwin.protocol.nmt import NmtState
from steptwin.protocol.pvt import PvtFlag
from tests.controller.bench_board import BenchBoard
from tests.controller.units import MS, STEP


def emergencies(board: BenchBoard, axis: int = 0) -> list[int]:
    return [int.from_bytes(data[:2], "little") for data in board.frames(0x090 + axis)]


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
        with pytest.raises(ValueError, match="1 to 8"):
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
        assert emergencies(board) == [ErrorCode.PDO_TOO_SHORT]

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
        assert [
            board.value(address)
            for address in (od.ERROR_REGISTER, od.ERROR_HISTORY_COUNT, od.ERROR_HISTORY[0], od.ERROR_CODE)
        ] == [0] * 4
        before = len(emergencies(board))
        board.wait(3000)
        assert len(emergencies(board)) == before

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
        assert emergencies(board) == [0x8210, 0x8210, 0x8220]
        board.send(0x210, bytes(3))
        assert (emergencies(board)[3:], board.value(od.ERROR_REGISTER)) == ([0], 0x11)
        board.record(0, 0, 10, 0)
        assert (emergencies(board)[4:], board.value(od.ERROR_REGISTER)) == ([0], 0)

    def test_a_sync_of_the_wrong_length_does_nothing_and_is_reported(self, board: BenchBoard) -> None:
        board.nmt(1)
        board.send(0x310, b"\x06\x00")
        board.send(0x080, b"\x01")
        assert (board.value(od.CONTROLWORD), board.frames(0x090)) == (0, [bytes.fromhex("4082 11 0100000000")])
        board.send(0x080, b"")
        assert (board.value(od.CONTROLWORD), emergencies(board)) == (6, [0x8240, 0])

    def test_sync_with_a_counter(self, board: BenchBoard) -> None:
        board.write(od.SYNC_COUNTER_OVERFLOW, 4)
        board.write(od.address_of(od.TPDO_COMMUNICATION[1], od.PDO_SYNC_START), 3)
        board.write(od.address_of(od.TPDO_COMMUNICATION[1], od.PDO_COB_ID), 0x290)
        board.nmt(1)
        board.send(0x080, b"")
        assert emergencies(board) == [0x8240]
        for counter in (1, 2, 3, 4, 1):
            board.send(0x080, bytes((counter,)))
        assert len(board.frames(0x290)) == 3

    def test_the_emergency_identifier_may_be_changed_and_switched_off(self, board: BenchBoard) -> None:
        board.nmt(1)
        assert board.write(od.EMCY_COB_ID, 0x0A0) == AbortCode.VALUE_RANGE
        assert board.write(od.EMCY_COB_ID, 1 << 31 | 0x090) == 0
        board.send(0x510, bytes(7))
        board.wait(1)
        assert (emergencies(board), board.value(od.ERROR_REGISTER)) == ([], 0x11)
        for refused in (1 << 30 | 0x090, 1 << 29 | 0x090, 0x800, 0x710):
            assert board.write(od.EMCY_COB_ID, refused) == AbortCode.VALUE_RANGE
        assert board.write(od.EMCY_COB_ID, 0x0A0) == 0
        board.record(0, 0, 10, 0)
        assert board.frames(0x0A0) == [bytes(8)]

    @given(st.lists(st.tuples(st.integers(0, 0x7FF), st.binary(max_size=8)), max_size=30))
    def test_junk_never_raises(self, frames: list[tuple[int, bytes]]) -> None:
        board = BenchBoard(python_kernel(), axes=2)
        board.enable()
        for cob_id, data in frames:
            board.send(cob_id, data)
            board.wait(0.3)
        assert board.firmware.dropped_frames <= len(frames)


class TestConfiguration:
    @pytest.mark.parametrize("microsteps", [1, 2, 8, 16])
    def test_microstep_settings_of_the_chip(self, board: BenchBoard, microsteps: int) -> None:
        assert board.write(od.MICROSTEPS, microsteps) == 0
        assert board.firmware.motion.config(0).microsteps == microsteps

    @pytest.mark.parametrize("microsteps", [3, 4, 15])
    def test_settings_that_the_chip_does_not_have(self, board: BenchBoard, microsteps: int) -> None:
        assert board.write(od.MICROSTEPS, microsteps) == AbortCode.VALUE_RANGE

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


class TestHoming:
    def test_method_37_presets_the_position_in_units(self, board: BenchBoard) -> None:
        board.enable(mode=6)
        board.write(od.HOME_OFFSET, 1500)
        assert not board.value(od.STATUSWORD) & 1 << 12
        board.write(od.CONTROLWORD, 0x1F)
        assert board.value(od.STATUSWORD) & 1 << 12
        assert (
            board.value(od.POSITION_DEMAND),
            board.value(od.POSITION_ACTUAL),
            board.value(od.FOLLOWING_ERROR_ACTUAL),
        ) == (1500, 1024, 476)

    def test_it_takes_a_rising_start_bit(self, board: BenchBoard) -> None:
        board.enable(mode=6)
        board.write(od.CONTROLWORD, 0x1F)
        board.write(od.HOME_OFFSET, 1500)
        board.write(od.CONTROLWORD, 0x1F)
        assert board.value(od.POSITION_DEMAND) == 0

    def test_it_closes_a_queue_whose_records_it_drops(self, board: BenchBoard) -> None:
        board.enable()
        for sequence in range(3):
            board.record(1000, 0, 10, sequence)
        for address, value in (
            (od.MODE_OF_OPERATION, 6),
            (od.CONTROLWORD, 0x1F),
            (od.CONTROLWORD, 0x0F),
            (od.MODE_OF_OPERATION, 7),
        ):
            assert board.write(address, value) == 0
        board.record(500, 0, 10, 3)
        board.write(od.CONTROLWORD, 0x1F)
        board.wait(100)
        assert board.value(od.POSITION_DEMAND) == 0
        assert (board.value(od.PVT_NEXT_SEQUENCE), board.value(od.PVT_FREE_RECORDS)) == (3, 0)

    @pytest.mark.parametrize("units", [2**31 - 1, -(2**31)])
    def test_at_the_ends_of_the_range_reports_stay_inside_it(self, board: BenchBoard, units: int) -> None:
        """At full steps the counter rounds to a step beyond the i32 range; the objects report the ends of the range."""
        board.write(od.MICROSTEPS, 1)
        board.enable(mode=6)
        board.write(od.HOME_OFFSET, units)
        board.write(od.CONTROLWORD, 0x1F)
        for address in (od.POSITION_DEMAND, od.POSITION_ACTUAL, od.FOLLOWING_ERROR_ACTUAL):
            index, _ = od.index_and_subindex(address)
            board.send(0x610, bytes((0x40, index & 0xFF, index >> 8, 0, 0, 0, 0, 0)))
            answer = board.last(0x590)
            assert answer[0] == 0x43
            if address != od.FOLLOWING_ERROR_ACTUAL:
                assert int.from_bytes(answer[4:], "little", signed=True) == units


class TestInterpolation:
    def test_a_stream_starts_with_sync_and_ends_at_rest(self, pair: BenchBoard) -> None:
        pair.enable()
        for axis in (0, 1):
            pair.record(10 * STEP, 0, 20, 0, axis)
            pair.record(-3 * STEP, 0, 20, 1, axis)
            assert pair.flags(axis) == PvtFlag.ARMED
        pair.wait(5.1)
        pair.start()
        assert pair.flags() & PvtFlag.RUNNING
        assert pair.value(od.STATUSWORD) & 1 << 12
        pair.wait(100)
        assert [pair.value(od.POSITION_ACTUAL, axis) for axis in (0, 1)] == [7 * STEP, 7 * STEP]
        assert pair.flags() == PvtFlag.EMPTY
        assert not pair.value(od.STATUSWORD) & 1 << 12
        assert pair.value(od.STATUSWORD) & 1 << 10
        first, second = (edges.clk_counts for edges in pair.firmware.motion.take_edges())
        assert list(first) == list(second)
        assert len(first) == 2 * 13

    def test_all_axes_start_in_the_tick_after_sync(self, board: BenchBoard) -> None:
        board.enable()
        board.record(0, 0, 1, 0)
        board.wait(1.1)  # in tick 4, which lasts from 1.00 to 1.25 ms
        board.start()
        board.wait(1.14)  # a record of 1 ms that began with tick 5 ends with tick 8, at 2.25 ms
        assert board.flags() & PvtFlag.RUNNING
        board.wait(0.02)
        assert not board.flags() & PvtFlag.RUNNING

    def test_flow_control(self, board: BenchBoard) -> None:
        board.enable()
        board.record(1, 0, 10, 1)  # record 0 is missing
        assert board.flags() & PvtFlag.GAP
        assert (board.value(od.PVT_NEXT_SEQUENCE), board.value(od.PVT_FREE_RECORDS), board.value(od.PVT_GAPS)) == (
            0,
            64,
            1,
        )
        for sequence in range(65):
            board.record(1, 0, 10, sequence)
        assert board.flags() & PvtFlag.OVERFLOW
        assert not board.flags() & PvtFlag.GAP
        assert (board.value(od.PVT_NEXT_SEQUENCE), board.value(od.PVT_FREE_RECORDS), board.value(od.PVT_OVERFLOWS)) == (
            64,
            0,
            1,
        )
        board.record(1, 0, 10, 5)  # an old record: ignored without a flag
        assert board.value(od.PVT_ACCEPTED) == 64

    def test_each_flag_is_one_event_only(self, board: BenchBoard) -> None:
        board.enable()
        board.wait(50)
        before = len(board.frames(0x390))
        for _ in range(5):
            board.record(1, 0, 10, 7)
            board.wait(5)
        assert len(board.frames(0x390)) == before + 1
        assert board.value(od.PVT_GAPS) == 5

    def test_clearing_begins_again_at_zero(self, board: BenchBoard) -> None:
        board.enable()
        board.record(100, 0, 10, 0)
        assert board.write(od.BUFFER_CLEAR, 0) == 0
        assert (board.value(od.PVT_NEXT_SEQUENCE), board.value(od.PVT_FREE_RECORDS), board.flags()) == (
            0,
            64,
            PvtFlag.EMPTY,
        )
        board.record(50, 0, 10, 0)
        board.start()
        assert board.write(od.BUFFER_CLEAR, 0) == AbortCode.DEVICE_STATE
        board.wait(20)
        assert board.value(od.POSITION_DEMAND) == 50

    def test_a_refused_record_is_flagged_and_reported(self, board: BenchBoard) -> None:
        board.enable()
        board.record(1000 * STEP, 0, 10, 0)
        assert board.flags() & PvtFlag.REJECTED
        assert board.frames(0x090) == [bytes.fromhex("03ff 81 0004000000")]  # refusal 4, sequence 0
        assert board.value(od.PVT_NEXT_SEQUENCE) == 0
        assert board.state() is State.OPERATION_ENABLED
        board.record(1000 * STEP, 0, 10, 0)
        assert emergencies(board) == [0xFF03], "sent again, it is the same error"
        board.write(od.BUFFER_CLEAR, 0)
        assert (emergencies(board), board.value(od.ERROR_REGISTER)) == ([0xFF03, 0], 0)

    def test_sequence_numbers_wrap(self, board: BenchBoard) -> None:
        board.enable()
        sent = 0
        for sent in range(40):
            board.record(10, 0, 5, sent)
        board.start()
        for sent in range(40, 700):
            board.record(10, 0, 5, sent % 256)
            board.wait(5)
        board.wait(300)
        assert board.flags() == PvtFlag.EMPTY
        assert board.value(od.POSITION_DEMAND) == 7000
        assert board.value(od.PVT_NEXT_SEQUENCE) == 700 % 256
        assert board.value(od.PVT_LEAST_FILL) >= 38


class TestStops:
    def moving(self, board: BenchBoard, records: int = 8) -> None:
        """Every axis runs at 4 kHz, axis 1 the other way, with 20 ms records."""
        board.write(od.QUICK_STOP_DECELERATION, 40_000 * STEP)
        board.write(od.PROFILE_DECELERATION, 40_000 * STEP)
        board.enable()
        for axis in range(len(board.firmware.nodes)):
            sign = 1 - 2 * axis
            board.record(sign * 40 * STEP, sign * 4 * STEP * 64, 20, 0, axis)
            for sequence in range(1, records):
                board.record(sign * 80 * STEP, sign * 4 * STEP * 64, 20, sequence, axis)
        board.start()
        board.wait(50)

    def test_underrun_stops_the_group_and_is_reported(self, pair: BenchBoard) -> None:
        """Axis 0 runs out of records at 4 kHz. Both ramp down in 100 ms, with their own codes, and stay referenced."""
        self.moving(pair, records=5)
        pair.record(-80 * STEP, -4 * STEP * 64, 20, 5, axis=1)
        pair.wait(49)
        assert pair.state(0) is State.OPERATION_ENABLED
        pair.wait(2)
        assert pair.state(0) is State.FAULT_REACTION_ACTIVE
        pair.wait(98)
        assert pair.state(0) is State.FAULT_REACTION_ACTIVE
        pair.wait(10)
        assert pair.state(0) is pair.state(1) is State.FAULT
        assert (emergencies(pair, 0), emergencies(pair, 1)) == ([0xFF01], [0xFF02])
        assert pair.value(od.ERROR_CODE) == ErrorCode.PVT_UNDERRUN
        assert pair.flags(0) & PvtFlag.UNDERRUN
        assert pair.value(od.PVT_UNDERRUNS) == 1
        assert pair.value(od.POSITION_DEMAND, 0) == pytest.approx((40 + 320 + 15) * STEP, abs=200 * STEP)
        assert abs(pair.value(od.FOLLOWING_ERROR_ACTUAL, 0)) <= 0.57 * STEP

    def test_without_group_stop_the_others_run_on(self, pair: BenchBoard) -> None:
        pair.write(od.GROUP_STOP, 0)
        self.moving(pair, records=5)
        pair.record(-40 * STEP, 0, 20, 5, axis=1)
        pair.wait(300)
        assert (pair.state(0), pair.state(1)) == (State.FAULT, State.OPERATION_ENABLED)
        assert pair.value(od.POSITION_DEMAND, 1) == -(40 + 320 + 40) * STEP

    def test_fault_is_reset_and_the_axis_works_on(self, board: BenchBoard) -> None:
        self.moving(board, records=3)
        board.wait(300)
        assert board.state() is State.FAULT
        board.write(od.CONTROLWORD, 0x80)
        assert board.state() is State.SWITCH_ON_DISABLED
        assert emergencies(board) == [0xFF01, 0]
        assert board.value(od.ERROR_CODE) == board.value(od.ERROR_REGISTER) == 0
        board.write(od.BUFFER_CLEAR, 0)
        board.enable()
        before = board.value(od.POSITION_DEMAND)
        board.record(5 * STEP, 0, 20, 0)
        board.start()
        board.wait(50)
        assert board.value(od.POSITION_DEMAND) == before + 5 * STEP

    def test_quick_stop_ramps_down_then_switches_off(self, board: BenchBoard) -> None:
        self.moving(board)
        board.write(od.CONTROLWORD, 0x02)
        assert board.state() is State.QUICK_STOP_ACTIVE
        board.wait(98)
        assert board.state() is State.QUICK_STOP_ACTIVE
        board.wait(10)
        assert board.state() is State.SWITCH_ON_DISABLED
        assert abs(board.value(od.FOLLOWING_ERROR_ACTUAL)) <= 0.57 * STEP

    def test_interpolation_is_stopped_by_its_enable_bit(self, board: BenchBoard) -> None:
        self.moving(board)
        board.write(od.CONTROLWORD, 0x0F)
        board.wait(110)
        assert board.state() is State.OPERATION_ENABLED
        assert not board.firmware.motion.running(0)
        assert not board.flags() & PvtFlag.RUNNING

    @pytest.mark.parametrize("words", [(0x02, 0x0F, 0x1F), (0x0F, 0x1F), (0x11F, 0x0F, 0x1F)])
    def test_a_start_bit_during_a_ramp_does_not_cut_it_short(self, board: BenchBoard, words: tuple[int, ...]) -> None:
        """The demand may never jump: at 4 kHz it moves by at most one step in 250 us."""
        self.moving(board)
        previous = board.value(od.POSITION_DEMAND)
        for word in words:
            board.write(od.CONTROLWORD, word)
        for _ in range(500):
            board.wait(0.25)
            assert abs(board.value(od.POSITION_DEMAND) - previous) <= STEP + 1
            previous = board.value(od.POSITION_DEMAND)
        assert not board.firmware.motion.running(0)
        assert board.state() is State.OPERATION_ENABLED

    def test_homing_waits_for_standstill(self, board: BenchBoard) -> None:
        self.moving(board)
        board.write(od.CONTROLWORD, 0x02)
        board.write(od.CONTROLWORD, 0x0F)
        assert board.write(od.MODE_OF_OPERATION, 6) == AbortCode.DEVICE_STATE
        board.wait(120)
        assert board.write(od.MODE_OF_OPERATION, 6) == 0
        board.write(od.CONTROLWORD, 0x1F)
        assert board.value(od.POSITION_DEMAND) == 0

    @pytest.mark.parametrize("controlword", [0x02, 0x07, 0x0F, 0x00])
    def test_records_that_arrive_during_and_after_a_stop_move_nothing(
        self, board: BenchBoard, controlword: int
    ) -> None:
        """A host that goes on streaming must not set the axis moving again; clearing the queue opens it."""
        self.moving(board)
        board.write(od.CONTROLWORD, controlword)
        for sequence in range(8, 30):
            board.record(80 * STEP, 4 * STEP * 64, 20, sequence)
            board.wait(10)
        assert not board.firmware.motion.running(0)
        assert (board.value(od.PVT_NEXT_SEQUENCE), board.value(od.PVT_FREE_RECORDS)) == (8, 0)
        assert board.flags() & PvtFlag.OVERFLOW
        assert board.write(od.BUFFER_CLEAR, 0) == 0
        assert (board.value(od.PVT_NEXT_SEQUENCE), board.value(od.PVT_FREE_RECORDS)) == (0, 64)

    def just_before_the_end(self, board: BenchBoard, end_velocity: int) -> None:
        """Run one record of 20 ms until the kernel has computed its last tick and the clock is within that tick."""
        board.enable()
        board.record(8 * STEP, end_velocity, 20, 0)
        board.start()
        board.wait(19.9)
        assert board.state() is State.OPERATION_ENABLED

    def test_voltage_cut_in_the_tick_before_an_underrun_stays_cut(self, board: BenchBoard) -> None:
        self.just_before_the_end(board, 64 * STEP)
        board.firmware.take_pins()
        board.write(od.CONTROLWORD, 0x00)
        board.wait(500)
        assert board.state() is State.SWITCH_ON_DISABLED
        assert [(change.pin, change.level) for change in board.firmware.take_pins()] == [(Pin.ENABLE, 0)]
        assert emergencies(board) == []

    def test_quick_stop_in_the_tick_before_an_underrun_is_a_ramp(self, board: BenchBoard) -> None:
        self.just_before_the_end(board, 64 * STEP)
        board.write(od.QUICK_STOP_DECELERATION, 20_000 * STEP)
        board.write(od.PROFILE_DECELERATION, 20_000 * STEP)
        board.write(od.CONTROLWORD, 0x02)
        assert board.state() is State.QUICK_STOP_ACTIVE
        board.wait(45)
        assert board.state() is State.QUICK_STOP_ACTIVE
        board.wait(15)
        assert board.state() is State.SWITCH_ON_DISABLED
        assert board.value(od.POSITION_DEMAND) == pytest.approx((8 + 25) * STEP, abs=2)
        assert emergencies(board) == []

    def test_an_axis_is_under_way_until_the_tick_of_its_end(self, board: BenchBoard) -> None:
        self.just_before_the_end(board, 0)
        assert not board.value(od.STATUSWORD) & 1 << 10
        board.record(STEP, 0, 20, 1)
        for word in (0x0F, 0x1F):  # too early to start again
            board.write(od.CONTROLWORD, word)
        board.wait(100)
        assert board.value(od.STATUSWORD) & 1 << 10
        assert not board.flags() & PvtFlag.RUNNING

    def test_a_fault_does_not_switch_a_drive_on(self, board: BenchBoard) -> None:
        with board.firmware.nodes[0].drive_at(0) as drive:
            drive.fault(ErrorCode.GROUP_STOPPED, detail=0, stop_ms=10)
        assert board.state() is State.SWITCH_ON_DISABLED
        assert emergencies(board) == []

    def at_the_end_of_the_range(self, board: BenchBoard) -> None:
        """Full steps, 800 units/ms, and 200 000 units from the end of i32: a ramp of 0.5 s needs as much again."""
        board.write(od.MICROSTEPS, 1)
        board.write(od.QUICK_STOP_DECELERATION, 100 * 16_384)
        board.write(od.PROFILE_DECELERATION, 100 * 16_384)
        board.enable(mode=6)
        board.write(od.HOME_OFFSET, 2**31 - 1 - 100_000)
        for address, value in ((od.CONTROLWORD, 0x1F), (od.CONTROLWORD, 0x0F), (od.MODE_OF_OPERATION, 7)):
            assert board.write(address, value) == 0
        for sequence, displacement in enumerate((4000, 8000, 8000)):
            board.record(displacement, 800 * 64, 10, sequence)
        board.start()

    def test_a_fault_without_room_for_its_ramp_ends_in_fault(self, board: BenchBoard) -> None:
        self.at_the_end_of_the_range(board)
        board.wait(31)
        assert board.state() is State.FAULT
        board.write(od.CONTROLWORD, 0x80)
        assert board.state() is State.SWITCH_ON_DISABLED

    @pytest.mark.parametrize(
        ("word", "target"),
        [
            (0x02, State.SWITCH_ON_DISABLED),
            (0x06, State.READY_TO_SWITCH_ON),
            (0x07, State.SWITCHED_ON),
            (0x0F, State.OPERATION_ENABLED),
        ],
    )
    def test_a_stop_without_room_for_its_ramp_is_done_at_once(
        self, board: BenchBoard, word: int, target: State
    ) -> None:
        self.at_the_end_of_the_range(board)
        board.wait(25)
        board.write(od.CONTROLWORD, word)
        assert board.state() is target
        assert board.value(od.PVT_FREE_RECORDS) == 0
        board.wait(1000)
        assert board.state() is target

    @pytest.mark.parametrize(
        ("words", "target"),
        [
            ((0x07, 0x0F), State.OPERATION_ENABLED),
            ((0x06, 0x1F), State.OPERATION_ENABLED),
            ((0x07, 0x06), State.READY_TO_SWITCH_ON),
            ((0x06, 0x0F, 0x07), State.SWITCHED_ON),
            ((0x07, 0x02), State.SWITCH_ON_DISABLED),
        ],
    )
    def test_the_last_command_during_a_ramp_decides_the_state_after_it(
        self, board: BenchBoard, words: tuple[int, ...], target: State
    ) -> None:
        self.moving(board)
        for word in words:
            board.write(od.CONTROLWORD, word)
            board.wait(2)
        assert board.firmware.motion.running(0)
        board.wait(110)
        assert not board.firmware.motion.running(0)
        assert board.state() is target

    def test_a_command_repeated_during_its_ramp_changes_nothing(self, board: BenchBoard) -> None:
        """A controlword repeated every 0.1 ms must not restart the ramp each time: it would never end."""
        self.moving(board)
        for _ in range(1020):
            board.write(od.CONTROLWORD, 0x07)
            board.wait(0.1)
        assert board.state() is State.SWITCHED_ON

    def test_disable_operation_ramps_down_first(self, board: BenchBoard) -> None:
        self.moving(board)
        board.write(od.CONTROLWORD, 0x07)
        assert board.state() is State.OPERATION_ENABLED
        board.wait(110)
        assert board.state() is State.SWITCHED_ON

    def test_disable_voltage_cuts_at_once(self, board: BenchBoard) -> None:
        self.moving(board)
        board.firmware.motion.take_edges()
        board.write(od.CONTROLWORD, 0x00)
        assert board.state() is State.SWITCH_ON_DISABLED
        board.wait(100)
        assert len(board.firmware.motion.take_edges()[0].clk_counts) == 0

    def test_quick_stop_at_rest_switches_off_at_once(self, board: BenchBoard) -> None:
        board.enable()
        board.write(od.CONTROLWORD, 0x02)
        assert board.state() is State.SWITCH_ON_DISABLED

    def test_steps_that_come_too_late_are_a_fault(self, board: BenchBoard) -> None:
        """A DIR setup of 1 ms delays the first step after a sharp reversal by more than a tick."""
        board.write(od.DIRSETUP_NS, 1_000_000)
        board.enable()
        board.record(10 * STEP, 0, 10, 0)
        board.record(-30 * STEP, 0, 7, 1)
        board.start()
        board.wait(100)
        assert emergencies(board) == [0xFF04]
        assert board.value(od.DELAYED_STEPS) > 0
