"""A host that does random things: valid commands, settings at their limits, junk, and operations of the hardware.

Every action ends up as frames or operations with instants, so that a session can be repeated without this module. What
it draws next may depend on what the board does, as far as a host could know: positions and expected sequence numbers.
"""

from collections.abc import Callable
from random import Random

from steptwin.controller.motion.backend import Kernel
from steptwin.emulator.operations import Operation
from steptwin.protocol import od
from steptwin.protocol.cia402 import SWITCH_INPUTS, Mode
from steptwin.protocol.entry import Access, Entry, Mapping
from steptwin.protocol.frame import (
    COB_HEARTBEAT,
    COB_ID_INVALID,
    COB_NMT,
    COB_RPDO,
    COB_SDO_REQUEST,
    COB_SYNC,
    COB_TPDO,
    FIRST_NODE_ID,
    HOST_NODE_ID,
    Frame,
)
from steptwin.protocol.homing_methods import HOMING_METHODS
from steptwin.protocol.objects import ENTRIES
from steptwin.protocol.od import RESTORES, STORES
from steptwin.protocol.pvt import PvtRecord
from steptwin.protocol.timer import COUNTS_PER_MS
from tests.emulator.random_host.machine import ACCELERATION, STEP, VELOCITY_MAX, Machine
from tests.emulator.random_host.machines import random_setup
from tests.emulator.random_host.sdo import download, request
from tests.emulator.random_host.session import Action, BusOff, Pause, PowerCycle, Session, Step
from tests.operations import BoardTemperature, DriverProtect, EmergencyStop, StuckSwitch, Supply

SAVE = int.from_bytes(b"save", "little")
LOAD = int.from_bytes(b"load", "little")
RAMPS = (od.PROFILE_ACCELERATION, od.PROFILE_DECELERATION, od.QUICK_STOP_DECELERATION, od.HOMING_ACCELERATION)
STEADY = frozenset((*RAMPS, od.MAX_PROFILE_VELOCITY, od.MAX_ACCELERATION, od.MAX_DECELERATION, *STORES, *RESTORES))
"""The entries that a host with steady ramps leaves alone, once it has set and stored them."""
WRITABLE = tuple(a for a, entry in ENTRIES.items() if entry.access in (Access.READ_WRITE, Access.WRITE_ONLY))
WORDS = (0x06, 0x07, 0x0F, 0x0F, 0x1F, 0x1F, 0x3F, 0x5F, 0x7F, 0x02, 0x00, 0x80, 0x10F, 0x11F, 0xFFFF)
LIKELY = {
    od.QUICK_STOP_OPTION: (0, 1, 2, 5, 6),
    od.TARGET_POSITION: (0, 1000, -300_000, 2_000_000, 2**31 - 1),
    od.POSITION_LIMIT_MIN: (-(2**31), -1_000_000, 0),
    od.POSITION_LIMIT_MAX: (2**31 - 1, 1_000_000, 0),
    od.FOLLOWING_ERROR_WINDOW: (0, 576, STEP, 2**32 - 1),
    od.PROFILE_VELOCITY: (1, 100_000, VELOCITY_MAX, 2**32 - 1),
    od.HOMING_TIMEOUT_MS: (0, 50, 10_000),
    od.HOMING_METHOD: tuple(HOMING_METHODS),
    od.HOMING_SEARCH_SPEED: (1_000_000, VELOCITY_MAX),
    od.HOMING_ZERO_SPEED: (100_000, VELOCITY_MAX),
    od.TARGET_VELOCITY: (0, 15, 1_000_000, -VELOCITY_MAX, 2**31 - 1),
    od.MICROSTEPS: (1, 2, 8, 16),
    od.TORQUE_PERCENT: (20, 50, 75, 100),
    od.REST_TORQUE_PERCENT: (20, 50, 100),
    od.STEPLEN_NS: (4_000, 30_000, 33_000, 1_000_000),
    od.STEPSPACE_NS: (4_000, 33_666, 1_000_000),
    od.DIRSETUP_NS: (0, 15_000, 1_000_000),
    od.DIRHOLD_NS: (0, 15_000, 1_000_000),
    od.POLARITY: (0, 0xC0),
    od.CONSUMER_HEARTBEATS[0]: (0, HOST_NODE_ID << 16 | 5, HOST_NODE_ID << 16 | 200),
    od.PRODUCER_HEARTBEAT_TIME: (0, 1, 50),
    od.EMCY_INHIBIT_TIME: (0, 10, 65_535),
    od.SYNC_COUNTER_OVERFLOW: (0, 1, 2, 240),
    od.STORE_ALL: (SAVE,),
    od.RESTORE_ALL: (LOAD,),
    od.BUFFER_CLEAR: (0,),
    od.MODE_OF_OPERATION: (*Mode, 99),
    od.CONTROLWORD: WORDS,
}
"""Values of entries that lead somewhere; other values are drawn as well."""
_SDO_COMMANDS = (
    0x40,
    0x40,
    0x21,
    0x20,
    0x00,
    0x10,
    0x0D,
    0x60,
    0x70,
    0x80,
    0xA0,
    0xA1,
    0xA2,
    0xA3,
    0xC2,
    0xC6,
    0xC1,
    0x01,
)
"""First bytes of requests: expedited, in segments and in blocks, in both directions, and abort."""
_MAPPABLE = {
    kind: tuple(a for a, entry in ENTRIES.items() if entry.mapping.value & kind.value)
    for kind in (Mapping.RECEIVE, Mapping.TRANSMIT)
}


class RandomHost:
    """Draws the steps of one session from a seed and lets a machine execute them at once."""

    def __init__(self, seed: int, kernel: Kernel) -> None:
        self._draw = Random(seed)
        self.machine = Machine(random_setup(self._draw), kernel)
        self.steps: list[Step] = []
        board = self.machine.setup.board
        self._axes = range(board.axis_count)
        self._steady = self.machine.setup.steady_ramps
        self._sdo_ms = 1000 * 280 / self.machine.setup.bitrate + board.read_latency_counts / COUNTS_PER_MS
        """Time for a request and its answer, if the bus has nothing else to do."""
        self._actions: dict[Callable[[], None], int] = {
            self._write_any: 30,
            self._write_likely: 30,
            self._controlword: 15,
            self._recover: 12,
            self._jog: 10,
            self._move: 10,
            self._home: 6,
            self._stream: 8,
            self._cycle: 6,
            self._records: 6,
            self._set_timing: 6,
            self._network: 8,
            self._reset_in_motion: 5,
            self._operate: 10,
            self._remap: 6,
            self._near_junk: 8,
            self._transfer: 6,
            self._junk: 6,
            self._flood: 3,
            self._overload: 2,
            self._sync: 6,
            self._host_heartbeat: 4,
            self._wait: 15,
            self._leave_bus: 1,
            self._power_cycle: 1,
        }

    @property
    def session(self) -> Session:
        """All steps so far."""
        return Session(self.machine.setup, tuple(self.steps))

    def act(self, actions: int) -> None:
        """Do a number of random actions."""
        if self._steady:
            self._set_steady_ramps()
        kinds, weights = list(self._actions), list(self._actions.values())
        for action in self._draw.choices(kinds, weights, k=actions):
            action()
            self.machine.look_closely()

    def end(self) -> None:
        """Note the instant of the end, which may be that of a failure."""
        self.steps.append(Step(self.machine.now_counts, Pause()))

    # --- ways to the machine

    def do(self, action: Action) -> None:
        """Do one thing now, and record it first, so that it is on record if it fails."""
        step = Step(self.machine.now_counts, action)
        self.steps.append(step)
        self.machine.execute(step)

    def pause(self, dt_ms: float) -> None:
        """Let time pass."""
        self.machine.pass_until(self.machine.now_counts + round(dt_ms * COUNTS_PER_MS))

    def send(self, cob_id: int, data: bytes, dt_ms: float | None = None) -> None:
        """Send a frame and let time pass; by default about as long as an answer takes, sometimes none."""
        self.do(Frame(cob_id, data))
        self.pause((self._sdo_ms if self._draw.random() < 0.8 else 0) if dt_ms is None else dt_ms)

    def write(self, axis: int, address: int, value: int) -> None:
        """Write an entry by SDO; what the board answers does not matter."""
        self.send(COB_SDO_REQUEST + FIRST_NODE_ID + axis, download(address, value))

    def _axis(self) -> int:
        return self._draw.choice(self._axes)

    def _watch(self) -> None:
        """Let a motion go on for a while."""
        self.pause(self._draw.choice((0.3, 1, 5, 20, 60)))

    def _value(self, axis: int, address: int) -> int:
        return self.machine.board.firmware.nodes[axis].dictionary.get(address)

    # --- settings

    def _set_steady_ramps(self) -> None:
        for axis in self._axes:
            values = dict.fromkeys(RAMPS, ACCELERATION) | {od.MAX_PROFILE_VELOCITY: VELOCITY_MAX, od.STORE_ALL: SAVE}
            for address, value in values.items():
                self.do(Frame(COB_SDO_REQUEST + FIRST_NODE_ID + axis, download(address, value)))
                self.pause(2 * self._sdo_ms)

    def _write_any(self) -> None:
        address = self._draw.choice(WRITABLE)
        self._write_unless_steady(address, self._any_value(ENTRIES[address]))

    def _write_likely(self) -> None:
        address = self._draw.choice(tuple(LIKELY))
        self._write_unless_steady(address, self._draw.choice(LIKELY[address]))

    def _write_unless_steady(self, address: int, value: int) -> None:
        if not (self._steady and address in STEADY):
            self.write(self._axis(), address, value)

    def _any_value(self, entry: Entry) -> int:
        """Draw a value for an entry: at its limits, within them or beyond."""
        kind = entry.data_type
        low = kind.low if entry.low is None else entry.low
        high = kind.high if entry.high is None else entry.high
        default = entry.default if isinstance(entry.default, int) else 0
        values = (low, high, default, 0, 1, low - 1, high + 1, self._draw.randint(low, high))
        value = self._draw.choice((*values, self._draw.randint(low, high) >> self._draw.randrange(32)))
        return min(max(value, kind.low), kind.high)

    def _set_timing(self) -> None:
        """Set the step timing of an axis, which must be off for it, and enable it again."""
        axis = self._axis()
        self.write(axis, od.CONTROLWORD, 0)
        for address in (od.STEPLEN_NS, od.STEPSPACE_NS, od.DIRSETUP_NS, od.DIRHOLD_NS):
            if self._draw.random() < 0.5:
                entry = ENTRIES[address]
                values = (*LIKELY[address], self._draw.randint(entry.low or 0, entry.high or 0))
                self.write(axis, address, self._draw.choice(values))
        self._enable(axis, Mode.PROFILE_VELOCITY)
        self._run(axis)

    # --- valid commands

    def _enable(self, axis: int, mode: int) -> None:
        for word in (0x80, 0x06, 0x07, 0x0F):
            self.write(axis, od.CONTROLWORD, word)
        self.write(axis, od.MODE_OF_OPERATION, mode)

    def _recover(self) -> None:
        """Bring the hardware in order, and enable the drives."""
        self._restore_hardware()
        self.send(COB_NMT, b"\x01\x00")
        mode = self._draw.choice(tuple(Mode))
        for axis in self._axes[: self._draw.randint(1, 3)]:
            self._enable(axis, mode)

    def _restore_hardware(self) -> None:
        for operation in restoring(len(self._axes)):
            self.do(operation)

    def _controlword(self) -> None:
        axis, word = self._axis(), self._draw.choice(WORDS)
        if self._draw.random() < 0.5:
            self.write(axis, od.CONTROLWORD, word)
        else:
            number = self._draw.choice((0, 1))
            self.send(COB_RPDO[number] + FIRST_NODE_ID + axis, word.to_bytes(2, "little"))

    def _run(self, axis: int) -> None:
        speed = self._draw.choice((STEP, 100 * STEP, -1500 * STEP, self._draw.randint(-VELOCITY_MAX, VELOCITY_MAX)))
        self.write(axis, od.TARGET_VELOCITY, speed)
        self._watch()

    def _jog(self) -> None:
        axis = self._axis()
        self._enable(axis, Mode.PROFILE_VELOCITY)
        self._run(axis)

    def _move(self) -> None:
        axis, bits = self._axis(), self._draw.choice((0, 0x20, 0x40, 0x60))
        self.write(axis, od.MODE_OF_OPERATION, Mode.PROFILE_POSITION)
        self.write(axis, od.PROFILE_VELOCITY, VELOCITY_MAX)
        self.write(axis, od.TARGET_POSITION, self._draw.randint(-3_000_000, 3_000_000))
        self.write(axis, od.CONTROLWORD, 0x1F | bits)
        self.write(axis, od.CONTROLWORD, 0x0F)
        self._watch()

    def _home(self) -> None:
        axis = self._axis()
        self._enable(axis, Mode.HOMING)
        self.write(axis, od.HOMING_SEARCH_SPEED, self._draw.choice(LIKELY[od.HOMING_SEARCH_SPEED]))
        self.write(axis, od.HOMING_METHOD, self._draw.choice(tuple(HOMING_METHODS)))
        self.write(axis, od.CONTROLWORD, 0x1F)
        self._watch()
        self._watch()

    def _stream(self) -> None:
        """Stream some axes out and back in step; a shorter queue runs out on the way."""
        self.send(COB_NMT, b"\x01\x00")
        axes = self._axes[: self._draw.randint(1, 3)]
        unit = self._draw.randint(-100_000, 100_000)
        for axis in axes:
            self._enable(axis, Mode.INTERPOLATED_POSITION)
            self.write(axis, od.BUFFER_CLEAR, 0)
            length = self._draw.randint(1, 12)
            for sequence in range(length):
                velocity = 0 if sequence == length - 1 else unit * 64 // 20
                self._record(axis, PvtRecord(unit if sequence else unit // 2, velocity, 20, sequence))
        for axis in axes:
            self.send(COB_RPDO[1] + FIRST_NODE_ID + axis, b"\x1f\x00")
        self.send(COB_SYNC, b"")
        self._watch()

    def _records(self) -> None:
        axis = self._axis()
        for _ in range(self._draw.choice((1, 3, 70))):
            record = PvtRecord(
                self._draw.randint(-40_000, 40_000),
                self._draw.choice((0, 0, 60_000, -200_000, 250_000)),
                self._draw.randint(0, 60),
                self._value(axis, od.PVT_NEXT_SEQUENCE),
            )
            self._record(axis, record)

    def _record(self, axis: int, record: PvtRecord) -> None:
        self.send(COB_RPDO[3] + FIRST_NODE_ID + axis, record.encode())

    def _cycle(self) -> None:
        """Send set-points with SYNC, then stop sending."""
        self.send(COB_NMT, b"\x01\x00")
        axes, period_ms = self._axes[: self._draw.randint(1, 2)], self._draw.randint(1, 10)
        for axis in axes:
            self._enable(axis, Mode.CYCLIC_SYNCHRONOUS_POSITION)
            self.write(axis, od.INTERPOLATION_PERIOD, period_ms)
        points = [self._value(axis, od.POSITION_DEMAND) for axis in axes]
        for _ in range(self._draw.randint(1, 12)):
            speed = self._draw.randint(-VELOCITY_MAX, VELOCITY_MAX)
            for axis in axes:
                points[axis] += speed * period_ms // 1000 // (axis + 1)
                target = min(max(points[axis], -(2**31)), 2**31 - 1).to_bytes(4, "little", signed=True)
                self.send(COB_RPDO[2] + FIRST_NODE_ID + axis, target, 0)
            self.send(COB_SYNC, b"", period_ms)
        self._watch()

    def _network(self) -> None:
        node = self._draw.choice((0, FIRST_NODE_ID, FIRST_NODE_ID + self._axis(), 0x7F))
        self.send(COB_NMT, bytes((self._draw.choice((1, 1, 1, 2, 128, 129, 130, 77)), node)))

    def _reset_in_motion(self) -> None:
        """Reset, stop or disable at an instant within a pulse."""
        axis = self._axis()
        self._enable(axis, Mode.PROFILE_VELOCITY)
        self._run(axis)
        self.pause(self._draw.random())
        if self._draw.random() < 0.5:
            self._network()
        else:
            self.write(axis, od.CONTROLWORD, self._draw.choice((0x00, 0x02, 0x06, 0x07)))
        self._watch()

    def _sync(self) -> None:
        self.send(COB_SYNC, self._draw.choice((b"", b"", b"\x01", self._bytes(3))))

    def _host_heartbeat(self) -> None:
        for _ in range(self._draw.randint(1, 3)):
            self.send(COB_HEARTBEAT + HOST_NODE_ID, b"\x05", self._draw.choice((1, 4, 20)))

    def _wait(self) -> None:
        self.pause(self._draw.choice((0.01, 0.1, 0.3, 1, 3, 10, 50, 100)))

    # --- the hardware

    def _operate(self) -> None:
        draw = self._draw
        operations: tuple[Operation, ...] = (
            EmergencyStop(draw.random() < 0.5),
            DriverProtect(self._axis(), draw.random() < 0.5),
            Supply(draw.choice((0, 999, 1000, 2400, 2400, 3400, 3401))),
            BoardTemperature(draw.choice((250, 250, 850, 851, -400))),
            StuckSwitch(self._axis(), draw.choice(SWITCH_INPUTS), draw.choice((True, False, None, None))),
        )
        self.do(draw.choice(operations))
        self._wait()

    def _power_cycle(self) -> None:
        self.do(PowerCycle())
        self._wait()

    def _leave_bus(self) -> None:
        self.do(BusOff())
        self._wait()

    # --- process data as nobody would set it up, and junk

    def _remap(self) -> None:
        """Set up a PDO in the order that CiA 301 demands; a step may be missing."""
        axis, number = self._axis(), self._draw.randrange(4)
        receive = self._draw.random() < 0.5
        place = (od.RPDO_COMMUNICATION if receive else od.TPDO_COMMUNICATION)[number]
        mapping = (od.RPDO_MAPPING if receive else od.TPDO_MAPPING)[number]
        cob_id = (COB_RPDO if receive else COB_TPDO)[number] + FIRST_NODE_ID + self._draw.choice((axis, axis, 0))
        choices = [a for a in _MAPPABLE[Mapping.RECEIVE if receive else Mapping.TRANSMIT] if a not in STEADY]
        mapped = [self._draw.choice(choices) for _ in range(self._draw.randint(0, 8))]
        types = (0, 1, 2, 240, 254, 255, 252, self._draw.randrange(256))
        writes = [
            (od.address_of(place, od.PDO_COB_ID), cob_id | COB_ID_INVALID),
            (od.address_of(place, od.PDO_TRANSMISSION_TYPE), self._draw.choice(types)),
            (od.address_of(mapping), 0),
            *((od.address_of(mapping, i), _word(a)) for i, a in enumerate(mapped, start=1)),
            (od.address_of(mapping), len(mapped)),
            (od.address_of(place, od.PDO_COB_ID), cob_id),
        ]
        if not receive:
            event_ms, inhibit_100us = self._draw.choice((0, 1, 5)), self._draw.choice((0, 1, 100))
            writes.insert(1, (od.address_of(place, od.PDO_EVENT_TIMER), event_ms))
            writes.insert(1, (od.address_of(place, od.PDO_INHIBIT_TIME), inhibit_100us))
        self.send(COB_NMT, b"\x80\x00")
        for address, value in writes:
            if self._draw.random() < 0.97:
                self.write(axis, address, value)
        self.send(COB_NMT, b"\x01\x00")

    def _bytes(self, at_most: int = 8) -> bytes:
        return self._draw.randbytes(self._draw.randint(0, at_most))

    def _near_junk(self) -> None:
        """Send any bytes to a service of a node, in the length that it expects or in another."""
        bases = (COB_SYNC, *COB_RPDO, *COB_TPDO, COB_SDO_REQUEST, COB_HEARTBEAT)
        self.send(self._draw.choice(bases) + FIRST_NODE_ID + self._axis(), self._bytes())

    def _transfer(self) -> None:
        """Send parts of SDO transfers of every kind, in an order that makes sense or does not."""
        axis = self._axis()
        for _ in range(self._draw.randint(1, 6)):
            command, address = self._draw.choice(_SDO_COMMANDS), self._draw.choice(tuple(ENTRIES))
            self.send(COB_SDO_REQUEST + FIRST_NODE_ID + axis, request(command, address, self._draw.randbytes(4)))

    def _junk(self) -> None:
        self.send(self._draw.randrange(0x800), self._bytes())

    def _flood(self) -> None:
        """Send many frames in a row, for the receive FIFOs and the queues behind them."""
        cob_id = self._draw.choice((COB_SYNC, *(base + FIRST_NODE_ID + self._axis() for base in COB_RPDO)))
        for _ in range(self._draw.choice((5, 20, 60, 60, 200))):
            self.send(cob_id, b"" if cob_id == COB_SYNC else self._bytes(), 0)
        self._wait()
        self.machine.look_at_queues()

    def _overload(self) -> None:
        """Let some nodes produce more than the bus carries: all TPDOs each millisecond, or with each SYNC."""
        self.send(COB_NMT, b"\x80\x00")
        kind = self._draw.choice((1, 254))
        for axis in self._axes[: self._draw.randint(1, 3)]:
            for number, place in enumerate(od.TPDO_COMMUNICATION):
                cob_id = COB_TPDO[number] + FIRST_NODE_ID + axis
                self.write(axis, od.address_of(place, od.PDO_TRANSMISSION_TYPE), kind)
                self.write(axis, od.address_of(place, od.PDO_EVENT_TIMER), 1)
                self.write(axis, od.address_of(place, od.PDO_COB_ID), cob_id)
        self.send(COB_NMT, b"\x01\x00")
        for _ in range(self._draw.randint(0, 40)):
            self.send(COB_SYNC, b"", 0.1)
        self.pause(self._draw.choice((10, 50)))
        self.machine.look_at_queues()


def restoring(axis_count: int) -> tuple[Operation, ...]:
    """Return the operations after which the hardware is in order."""
    protects = (DriverProtect(axis, active=False) for axis in range(axis_count))
    free = (StuckSwitch(axis, switch, closed=None) for axis in range(axis_count) for switch in SWITCH_INPUTS)
    return (EmergencyStop(pressed=False), Supply(2400), BoardTemperature(250), *protects, *free)


def _word(address: int) -> int:
    """Return the word that maps an entry into a PDO."""
    return address << 8 | 8 * ENTRIES[address].data_type.size
