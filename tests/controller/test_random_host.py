"""A board under a random host: valid commands, junk, switches, brown-outs and silence, for thousands of steps.

After each step the tests check invariants from outside: from pins, edges and objects read over the bus. At the end of a
run all steps are repeated on a board with the other kernel, which must give the same bytes.
"""

from collections.abc import Callable
from importlib.util import find_spec

import numpy as np
from hypothesis import Phase, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from steptwin.controller.backend import KERNELS, Kernel
from steptwin.controller.pins import Pin
from steptwin.protocol import od
from steptwin.protocol.cia402 import Control, DigitalInput, Mode, State, Status
from tests.controller.bench_board import BenchBoard
from tests.controller.kernel_rig import Timing, pin_timing_faults
from tests.controller.units import MS, STEP

AXES = 2
ACCELERATION = 40_000 * STEP
"""Acceleration of every ramp of a profile, a stop or a fault, in units/s2."""
RAMPS = (od.PROFILE_ACCELERATION, od.PROFILE_DECELERATION, od.QUICK_STOP_DECELERATION, od.HOMING_ACCELERATION)
LONG_PULSE_NS = 1_000_000
VELOCITY_MAX = 4_000 * STEP
ROUNDING = 4 * STEP
"""Most that velocities a ms apart may differ beyond the ramp: 1/64 unit per ms, whole milliseconds, whole units."""

axes = st.integers(0, AXES - 1)
INPUTS = (DigitalInput(0), *DigitalInput, DigitalInput.NEGATIVE_LIMIT | DigitalInput.POSITIVE_LIMIT)
WORDS = (0x06, 0x07, 0x0F, 0x0F, 0x1F, 0x1F, 0x3F, 0x5F, 0x02, 0x00, 0x80, 0x10F, 0x11F)
OBJECTS = {
    od.QUICK_STOP_OPTION: (0, 1, 2, 5, 6),
    od.SHUTDOWN_OPTION: (0, 1),
    od.DISABLE_OPERATION_OPTION: (0, 1),
    od.HALT_OPTION: (1, 2),
    od.FAULT_REACTION_OPTION: (0, 1, 2),
    od.ABORT_CONNECTION_OPTION: (0, 1, 2, 3),
    od.FOLLOWING_ERROR_WINDOW: (0, 576, STEP, 2**32 - 1),
    od.POSITION_WINDOW: (0, 512, 2**32 - 1),
    od.TARGET_POSITION: (0, 1000, -300_000, 2_000_000, 2**31 - 1),
    od.HOME_OFFSET: (0, 500, -1_000_000),
    od.POSITION_LIMIT_MIN: (-(2**31), -1_000_000, 0),
    od.POSITION_LIMIT_MAX: (2**31 - 1, 1_000_000, 0),
    od.PROFILE_VELOCITY: (1, 100_000, VELOCITY_MAX, 2**32 - 1),
    od.MOTION_PROFILE_TYPE: (0, 3),
    od.HOMING_TIMEOUT_MS: (0, 50, 10_000),
    od.HOMING_METHOD: (17, 18, 19, 22, 23, 30, 35, 37, 37),
    od.HOMING_SEARCH_SPEED: (1_000_000, VELOCITY_MAX),
    od.HOMING_ZERO_SPEED: (100_000, VELOCITY_MAX),
    od.TARGET_VELOCITY: (0, 15, 1_000_000, -VELOCITY_MAX, 2**31 - 1),
    od.BUFFER_CLEAR: (0,),
    od.MICROSTEPS: (1, 2, 8, 16),
    od.STEPLEN_NS: (33_000, 33_000, LONG_PULSE_NS),
    od.REST_TORQUE_PERCENT: (20, 50, 100),
    od.GROUP_STOP: (0, 1),
    od.POLARITY: (0, 0xC0),
    od.CONSUMER_HEARTBEATS[0]: (0, 0x7F_0005),
    od.COMMUNICATION_ERROR_BEHAVIOUR: (0, 1, 2),
    od.STORE_ALL: (int.from_bytes(b"save", "little"),),
}
writes = st.sampled_from([(address, value) for address, values in OBJECTS.items() for value in values])
spells = st.integers(0, 200)
"""Time for which a motion is watched, in ms."""
Step = Callable[["WatchedBoard"], None]


class WatchedBoard(BenchBoard):
    """A bench board with an observer at its pins, which counts steps and records when drivers were enabled."""

    def __init__(self, kernel: Kernel) -> None:
        super().__init__(kernel, AXES)
        self.rises: list[list[int]] = [[] for _ in range(AXES)]
        self.falls: list[list[int]] = [[] for _ in range(AXES)]
        self.dir_edges: list[list[tuple[int, int]]] = [[] for _ in range(AXES)]
        self.enabled: list[list[tuple[int, int]]] = [[(-1, 0)] for _ in range(AXES)]
        self.steps = [0] * AXES
        """Position of each axis by the observer's count, from the last position that was set."""
        self.given = [False] * AXES
        """Whether the host has given a target, or started a motion, since the drive was enabled."""
        for axis in range(AXES):
            self.watch_targets(axis)
        preset = self.firmware.motion.preset

        def watched_preset(axis: int, position_units: int) -> None:
            self.observe()
            preset(axis, position_units)
            self.steps[axis] = self.firmware.motion.counter_steps(axis)

        self.firmware.motion.preset = watched_preset  # type: ignore[method-assign]

    def watch_targets(self, axis: int) -> None:
        """Note each target and each start that an axis takes while its drive is enabled."""
        drive, hooks = self.firmware.nodes[axis].drive, self.firmware.nodes[axis].dictionary.write_hooks

        def watched(address: int, starts: Callable[[int], bool]) -> None:
            obey = hooks[address]

            def write(value: int) -> None:
                was_enabled = drive.state is State.OPERATION_ENABLED
                obey(value)
                enabled = drive.state is State.OPERATION_ENABLED
                self.given[axis] = enabled and ((self.given[axis] and was_enabled) or starts(value))

            hooks[address] = write

        watched(od.TARGET_VELOCITY, lambda _: True)
        watched(od.TARGET_POSITION, lambda _: True)
        watched(od.CONTROLWORD, lambda word: bool(word & Control.START))

    def observe(self) -> None:
        """Record the changes of the pins."""
        for axis, edges in enumerate(self.firmware.motion.take_edges()):
            rises = [int(counts) for counts in edges.clk_counts[0::2]]
            words = [int(word) for word in edges.direction]
            self.dir_edges[axis] += [(word >> 1, word & 1) for word in words]
            self.rises[axis] += rises
            self.falls[axis] += [int(counts) for counts in edges.clk_counts[1::2]]
            levels = np.array([0] + [level for _, level in self.dir_edges[axis]])
            at = np.searchsorted([counts for counts, _ in self.dir_edges[axis]], rises, side="right")
            sign = -1 if self.firmware.motion.config(axis).dir_inverted else 1
            self.steps[axis] += sign * int((2 * levels[at] - 1).sum())
        for change in self.firmware.take_pins():
            if change.pin is Pin.ENABLE:
                self.enabled[change.axis].append((change.counts, change.level))

    def trace(self) -> tuple[object, ...]:
        """Return every edge, enable change and frame of the board."""
        self.observe()
        return self.rises, self.falls, self.dir_edges, self.enabled, self.sent


class RandomHost(RuleBasedStateMachine):
    """A host that does random steps, and records them so that they can be repeated on the other kernel."""

    def __init__(self) -> None:
        super().__init__()
        self.board = WatchedBoard(KERNELS["python"]())
        self.script: list[Step] = []

    def do(self, step: Step) -> None:
        self.script.append(step)
        step(self.board)

    def now(self, step: Step) -> None:
        """Do a step that takes no time. An axis that ends a motion at once must give up its position reference."""
        velocities = [self.board.firmware.motion.velocity(axis) for axis in range(AXES)]
        self.do(step)
        for axis, velocity in enumerate(velocities):
            self.check_cut(axis, velocity)

    def check_cut(self, axis: int, velocity_before: int) -> None:
        motion = self.board.firmware.motion
        if velocity_before and not motion.running(axis) and not motion.velocity(axis):
            assert not self.board.has(Status.POSITION_KNOWN, axis), "cut in motion, and says that it knows where it is"

    # --- steps

    @initialize()
    def set_up(self) -> None:
        def configure(board: WatchedBoard) -> None:
            for axis in range(AXES):
                for address in RAMPS:
                    board.write(address, ACCELERATION, axis)
                board.write(od.MAX_PROFILE_VELOCITY, VELOCITY_MAX, axis)
                board.write(od.STORE_ALL, int.from_bytes(b"save", "little"), axis)
            board.enable(Mode.HOMING)

        self.do(configure)

    @rule(word=st.sampled_from(WORDS), axis=axes)
    def controlword(self, word: int, axis: int) -> None:
        self.now(lambda board: (board.write(od.CONTROLWORD, word, axis), None)[1])

    @rule(mode=st.sampled_from(Mode))
    def recover(self, mode: int) -> None:
        """Restore inputs and supply, and enable every drive."""

        def walk(board: WatchedBoard) -> None:
            board.set_inputs(DigitalInput(0))
            board.measure()
            board.nmt(1)
            for axis in range(AXES):
                for word in (0x80, 0x06, 0x07, 0x0F):
                    board.write(od.CONTROLWORD, word, axis)
                board.write(od.MODE_OF_OPERATION, mode, axis)

        self.do(walk)

    @rule(axis=axes, velocity=st.integers(-VELOCITY_MAX, VELOCITY_MAX), slices=spells)
    def jog(self, axis: int, velocity: int, slices: int) -> None:
        def walk(board: WatchedBoard) -> None:
            board.write(od.MODE_OF_OPERATION, Mode.PROFILE_VELOCITY, axis)
            board.write(od.TARGET_VELOCITY, velocity, axis)

        self.do(walk)
        self.watch(slices)

    @rule(
        axis=axes,
        target_units=st.integers(-3_000_000, 3_000_000),
        bits=st.sampled_from([0, 0x20, 0x40, 0x60]),
        slices=spells,
    )
    def move(self, axis: int, target_units: int, bits: int, slices: int) -> None:
        def walk(board: WatchedBoard) -> None:
            board.write(od.MODE_OF_OPERATION, Mode.PROFILE_POSITION, axis)
            board.write(od.PROFILE_VELOCITY, VELOCITY_MAX, axis)
            board.write(od.TARGET_POSITION, target_units, axis)
            board.write(od.CONTROLWORD, 0x1F | bits, axis)
            board.write(od.CONTROLWORD, 0x0F, axis)

        self.do(walk)
        self.watch(slices)

    @rule(axis=axes, word=st.sampled_from([0x00, 0x02, 0x06, 0x07]), dt_counts=st.integers(1, 2 * MS))
    def leave(self, axis: int, word: int, dt_counts: int) -> None:
        """Stop from speed, in the middle of a servo tick."""
        self.jog(axis, VELOCITY_MAX, 120)
        self.wait(dt_counts)
        self.controlword(word, axis)
        self.watch(60)

    @rule(axis=axes, method=st.sampled_from([17, 18, 19, 22, 24, 29, 35, 37]), slices=spells)
    def home(self, axis: int, method: int, slices: int) -> None:
        def walk(board: WatchedBoard) -> None:
            board.write(od.HOMING_METHOD, method, axis)
            for word in (0x0F, 0x1F):
                board.write(od.MODE_OF_OPERATION, Mode.HOMING, axis)
                board.write(od.CONTROLWORD, word, axis)

        self.do(walk)
        self.watch(slices)
        self.flip(axis)
        self.watch(slices)

    @rule(axis=axes)
    def flip(self, axis: int) -> None:
        """Change every switch of an axis."""
        switches = DigitalInput.NEGATIVE_LIMIT | DigitalInput.POSITIVE_LIMIT | DigitalInput.HOME
        self.now(lambda board: board.set_inputs(board.inputs[axis] ^ switches, axis))

    @rule(lengths=st.tuples(st.integers(1, 40), st.integers(1, 40)), unit=st.integers(-100_000, 100_000), slices=spells)
    def stream(self, lengths: tuple[int, int], unit: int, slices: int) -> None:
        """Stream both axes out and back in step, on long paths; the shorter queue runs out on the way."""
        self.recover(Mode.INTERPOLATED_POSITION)

        def walk(board: WatchedBoard) -> None:
            for axis, length in enumerate(lengths):
                board.write(od.BUFFER_CLEAR, 0, axis)
                for sequence in range(length):
                    last = sequence == max(lengths) - 1
                    board.record(unit if sequence else unit // 2, 0 if last else unit * 64 // 20, 20, sequence, axis)
            board.start()

        self.do(walk)
        self.watch(slices)

    @rule(
        speeds=st.lists(st.integers(-VELOCITY_MAX, VELOCITY_MAX), min_size=1, max_size=30),
        period_ms=st.integers(1, 10),
        slices=spells,
    )
    def cycle(self, speeds: list[int], period_ms: int, slices: int) -> None:
        """Send set-points to one axis and half of them to the other, then stop sending."""
        self.recover(Mode.CYCLIC_SYNCHRONOUS_POSITION)
        for axis in range(AXES):
            self.write((od.INTERPOLATION_PERIOD, period_ms), axis)
        points = [self.board.value(od.POSITION_DEMAND, axis) for axis in range(AXES)]
        for speed in speeds:
            for axis in range(AXES):
                points[axis] += speed * period_ms // 1000 // (axis + 1)
                target = min(max(points[axis], -(2**31)), 2**31 - 1).to_bytes(4, "little", signed=True)
                self.near_junk(0x400, axis, target)
            self.junk(0x080, b"")
            self.watch(period_ms)
        self.watch(slices)

    @rule(mode=st.sampled_from([*Mode, 99]), axis=axes)
    def mode(self, mode: int, axis: int) -> None:
        self.do(lambda board: (board.write(od.MODE_OF_OPERATION, mode, axis), None)[1])

    @rule(write=writes, axis=axes)
    def write(self, write: tuple[int, int], axis: int) -> None:
        self.do(lambda board: (board.write(*write, axis), None)[1])

    @rule(
        axis=axes,
        segments=st.lists(
            st.tuples(
                st.integers(-40_000, 40_000),
                st.sampled_from([0, 0, 60_000, -200_000, 250_000]),
                st.integers(0, 60),
            ),
            min_size=1,
            max_size=6,
        ),
    )
    def records(self, axis: int, segments: list[tuple[int, int, int]]) -> None:
        def send(board: WatchedBoard) -> None:
            for displacement, velocity, duration_ms in segments:
                board.record(displacement, velocity, duration_ms, board.value(od.PVT_NEXT_SEQUENCE, axis), axis)

        self.do(send)

    @rule()
    def start(self) -> None:
        self.do(BenchBoard.start)

    @rule(command=st.sampled_from([1, 1, 1, 2, 128, 129, 130]), node=st.sampled_from([0, 0x10, 0x11]))
    def network(self, command: int, node: int) -> None:
        self.now(lambda board: board.nmt(command, node))

    @rule(cob_id=st.integers(0, 0x7FF), data=st.binary(max_size=8))
    def junk(self, cob_id: int, data: bytes) -> None:
        self.now(lambda board: board.send(cob_id, data))

    @rule(
        base=st.sampled_from([0x080, 0x200, 0x300, 0x400, 0x500, 0x600, 0x700]), axis=axes, data=st.binary(max_size=8)
    )
    def near_junk(self, base: int, axis: int, data: bytes) -> None:
        self.now(lambda board: board.send(base + 0x10 + axis, data))

    @rule(inputs=st.sampled_from(INPUTS), axis=axes)
    def inputs(self, inputs: DigitalInput, axis: int) -> None:
        self.now(lambda board: board.set_inputs(inputs, axis))

    @rule(
        supply_10mv=st.sampled_from([2400, 2400, 999, 3401]), temperature_decidegc=st.sampled_from([250, 250, 250, 851])
    )
    def measure(self, supply_10mv: int, temperature_decidegc: int) -> None:
        self.now(lambda board: board.measure(supply_10mv, temperature_decidegc))

    @rule(dt_counts=st.integers(1, 2 * MS))
    def wait(self, dt_counts: int) -> None:
        self.do(lambda board: board.wait(dt_counts / MS))

    @rule(slices=spells)
    def let_go_on(self, slices: int) -> None:
        self.watch(slices)

    def watch(self, slices: int) -> None:
        """Let time pass millisecond by millisecond, and check the velocities."""
        for _ in range(slices):
            self.watch_one_ms()

    def watch_one_ms(self) -> None:
        motion = self.board.firmware.motion
        before = [self.velocity(axis) for axis in range(AXES)]
        streaming = [node.drive.mode.coordinated for node in self.board.firmware.nodes]
        enabled = [node.drive.state is State.OPERATION_ENABLED for node in self.board.firmware.nodes]
        step: Step = lambda board: board.wait(1)  # noqa: E731
        self.script.append(step)
        step(self.board)
        for axis in range(AXES):
            now = self.velocity(axis)
            assert abs(now) <= VELOCITY_MAX, "too fast"
            if enabled[axis] and not before[axis] and not self.board.given[axis]:
                assert not now, "an axis that was only enabled sets off"
            cut = not self.board.has(Status.POSITION_KNOWN, axis) and not motion.running(axis)
            if not (cut or streaming[axis]):
                assert abs(now - before[axis]) <= ACCELERATION / 1000 + ROUNDING, "too much acceleration"

    def velocity(self, axis: int) -> int:
        """Return the demanded velocity in units per second."""
        return self.board.firmware.motion.velocity(axis) * 1000 // 64

    # --- invariants

    @invariant()
    def counters_follow_edges(self) -> None:
        self.board.observe()
        for axis in range(AXES):
            assert self.board.steps[axis] == self.board.firmware.motion.counter_steps(axis)

    @invariant()
    def no_step_is_owed(self) -> None:
        for axis in range(AXES):
            motion = self.board.firmware.motion
            owed_units = abs(motion.demand_units(axis) - motion.counter_units(axis))
            assert owed_units <= 16_384 * 9 // 16 // motion.config(axis).microsteps + 1

    @invariant()
    def no_edge_while_disabled(self) -> None:
        for axis in range(AXES):
            times, levels = zip(*self.board.enabled[axis], strict=True)
            assert list(times) == sorted(times)
            at_rise = np.searchsorted(times, self.board.rises[axis][-200:], side="right") - 1
            assert all(levels[i] for i in at_rise)

    @invariant()
    def a_disabled_axis_stands(self) -> None:
        for node in self.board.firmware.nodes:
            assert node.drive.energised or not self.board.firmware.motion.running(node.axis)

    @invariant()
    def the_state_is_one(self) -> None:
        for axis in range(AXES):
            assert State.of(self.board.value(od.STATUSWORD, axis)) is self.board.state(axis)

    def teardown(self) -> None:
        """Check the pulse timing and ENABLE, then repeat all steps on the other kernel and compare."""
        for axis in range(AXES):
            edges = self.board.rises[axis], self.board.falls[axis], self.board.dir_edges[axis]
            faults = pin_timing_faults(*edges, Timing())
            assert [
                fault for fault in faults if not fault.endswith(f"is {LONG_PULSE_NS * MS // 10**6} counts high")
            ] == []
            pulses = zip(self.board.rises[axis], self.board.falls[axis], strict=True)
            changes = [counts for counts, _ in self.board.enabled[axis]]
            assert not [pulse for pulse in pulses if any(pulse[0] <= counts < pulse[1] for counts in changes)]
        again = WatchedBoard(KERNELS["numba" if find_spec("numba") else "python"]())
        for step in self.script:
            step(again)
            again.observe()
        assert again.trace() == self.board.trace()


RandomHost.TestCase.settings = settings(
    max_examples=40,
    stateful_step_count=100,
    phases=[Phase.generate],  # to find a shorter script for a failure would take minutes
)
TestRandomHost = RandomHost.TestCase
