"""An emulated board under observation: it executes the steps of a session and checks what must hold at any time.

What must hold is stated by the messages of `BrokenInvariantError`. The pins are judged at the end.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from steptwin.controller.motion.axis_motion import AxisMotion, PinEdges
from steptwin.controller.motion.backend import Kernel
from steptwin.controller.motion.step_config import StepConfig
from steptwin.controller.node.pins import Pin, PinChange
from steptwin.emulator.board.board import Board
from steptwin.emulator.bus.can_bus import Bus
from steptwin.emulator.drivers.limits import Rule
from steptwin.emulator.simulation import Simulation
from steptwin.protocol import od
from steptwin.protocol.cia402 import Control, Mode, State, Status
from steptwin.protocol.drivers import Oscillator
from steptwin.protocol.frame import Frame
from steptwin.protocol.timer import COUNTS_PER_MS, counts_of_ns
from tests.emulator.pins import PERIOD
from tests.emulator.random_host.pins import PinRecord, level_faults
from tests.emulator.random_host.queues import overfull, overgrown
from tests.emulator.random_host.session import BusOff, Pause, PowerCycle, Session, Setup, Step

STEP = 1024
"""Wire units in a step at 16 microsteps."""
ACCELERATION = 40_000 * STEP
"""Acceleration of every ramp of a profile, a stop or a fault, in units/s2, where the ramps are steady."""
VELOCITY_MAX = 4_000 * STEP
VELOCITY_ROUNDING = 4 * STEP
"""Most that velocities may differ beyond the ramp: 1/64 unit per ms, whole milliseconds, whole units."""
_STREAMED = (Mode.INTERPOLATED_POSITION, Mode.CYCLIC_SYNCHRONOUS_POSITION)
"""The modes in which the host plans the accelerations. A mode stays while its axis moves."""
_TICKS_PER_S = 4000
_CLK_WIDTH_COUNTS = Oscillator(330).clk_width_min_counts


class BrokenInvariantError(AssertionError):
    """Something that must hold at any time does not."""


class _AxisWatch:
    """What was seen of an axis when it was last looked at."""

    def __init__(self, pins: PinRecord) -> None:
        self.pins = pins
        self.given = False
        """True if the host has given a target, or started a motion, since the drive was enabled."""
        self.shift = 0
        """The firmware's step counter less the steps made since power-up."""
        self.made = 0
        """Steps made since power-up, by the firmware's count."""
        self.rested = True
        """True until the axis moves for a target that was given."""
        self.velocity = 0
        self.speed_max = 0
        """Highest speed limit since the axis stood with an empty queue, in units/s."""


class Machine:
    """A board and its machine, which a host's steps act on."""

    def __init__(self, setup: Setup, kernel: Kernel, *, watched: bool = True) -> None:
        """Switch the board on; unless it is `watched`, only the pins are recorded."""
        self.setup = setup
        self.board = Board(setup.board, kernel)
        self.bus = Bus(setup.bitrate)
        self.simulation = Simulation([self.board], self.bus)
        self.axes = [_AxisWatch(PinRecord()) for _ in range(setup.board.axis_count)]
        self.power_cycles: list[int] = []
        self._watched = watched
        self._tick = 0
        self._slow_enough = True
        """False once a step timing was set that is too fast for the chip."""
        self._observe()

    # --- the host's steps

    def execute(self, step: Step) -> None:
        """Let time pass until a step is due, then do it."""
        self.pass_until(step.at_counts)
        action = step.action
        if isinstance(action, Frame):
            self.simulation.host.send(action, self.now_counts)
        elif isinstance(action, PowerCycle):
            self._power_cycle()
        elif isinstance(action, BusOff):
            if not self.bus.busy:  # `throw_off` is for an idle wire
                self.bus.throw_off(self.board.can, self.now_counts)
        elif not isinstance(action, Pause):
            with self._without_silent_cut():
                self.simulation.operate(action)

    @property
    def now_counts(self) -> int:
        """The time in counts since the board was switched on."""
        return self.simulation.now_counts

    def pass_until(self, until_counts: int) -> None:
        """Let time pass, and look at the board every few milliseconds."""
        if self._watched:
            self.look()
            while self.now_counts + (slice_counts := self._slice_counts) < until_counts:
                self.simulation.run_until(self.now_counts + slice_counts)
                self.look()
        self.simulation.run_until(until_counts)

    @property
    def _slice_counts(self) -> int:
        return (4 if self.board.moving else 10) * COUNTS_PER_MS

    def _power_cycle(self) -> None:
        self.board.drain()
        self.simulation.power_cycle()
        self.power_cycles.append(self.now_counts)
        for watch in self.axes:
            watch.pins.cut_off(self.now_counts)
        self.axes = [_AxisWatch(watch.pins) for watch in self.axes]
        self._observe()

    # --- observers

    def _observe(self) -> None:
        """Put observers to a firmware that has just got its power."""
        for axis, (motion, watch) in enumerate(zip(self.board.firmware.motion.axes, self.axes, strict=True)):
            observers: dict[str, Callable[..., object]] = {
                "take_edges": self._seen(motion, watch),
                "preset": self._shifting(motion.preset, motion, watch),
                "renumber": self._shifting(motion.renumber, motion, watch),
                "configure": self._drained(motion.configure),
            }
            for name, observer in observers.items():
                setattr(motion, name, observer)
            watch.shift = motion.counter_steps
            if self._watched:
                self._watch_targets(axis)
        if self._watched:
            receive = self.board.can.receive

            def received(frame: Frame, now_counts: int) -> None:
                self.board.drain()  # what has been made so far was made with the present configuration
                self.look()
                with self._without_silent_cut():
                    receive(frame, now_counts)
                self._note_timing()

            self.board.can.receive = received

    @staticmethod
    def _seen(motion: AxisMotion, watch: _AxisWatch) -> Callable[[], PinEdges]:
        """Show an axis' edges to the watch when they are taken."""
        take_edges = motion.take_edges

        def taken() -> PinEdges:
            edges = take_edges()
            watch.pins.see(edges, motion.config)
            return edges

        return taken

    def _drained(self, configure: Callable[[StepConfig], None]) -> Callable[[StepConfig], None]:
        """Drain what has been made with a configuration before it changes, as at the end of a reset."""

        def configured(config: StepConfig) -> None:
            self.board.drain()
            configure(config)

        return configured

    @staticmethod
    def _shifting(count: Callable[..., None], motion: AxisMotion, watch: _AxisWatch) -> Callable[..., None]:
        """Note by how much a new position shifts the step counter, which makes no step."""

        def counted(*arguments: int) -> None:
            before = motion.counter_steps
            count(*arguments)
            watch.shift += motion.counter_steps - before

        return counted

    def _watch_targets(self, axis: int) -> None:
        """Note each target and each start that an axis takes while its drive is enabled."""
        node, watch = self.board.firmware.nodes[axis], self.axes[axis]

        def watched(address: int, starts: Callable[[int], bool]) -> None:
            cell = node.dictionary.cell(address)
            obey = cell.obey
            assert obey is not None

            def write(value: int) -> None:
                was_enabled = node.drive.state is State.OPERATION_ENABLED
                obey(value)
                enabled = node.drive.state is State.OPERATION_ENABLED
                watch.given = enabled and ((watch.given and was_enabled) or starts(value))

            cell.obey = write

        watched(od.TARGET_VELOCITY, lambda _: True)
        watched(od.TARGET_POSITION, lambda _: True)
        watched(od.CONTROLWORD, lambda word: bool(word & Control.START))

    @contextmanager
    def _without_silent_cut(self) -> Iterator[None]:
        """Check that an axis whose motion ends at once gives up its position reference."""
        moving = [item for item in enumerate(self.board.firmware.motion.axes) if item[1].running and item[1].velocity]
        yield
        for axis, motion in moving:
            if not motion.running and not motion.velocity and self._has(axis, Status.POSITION_KNOWN):
                raise BrokenInvariantError(f"axis {axis} was cut in motion and says that it knows its position")

    def _note_timing(self) -> None:
        motion = self.board.firmware.motion
        for axis in range(motion.axis_count):
            config = motion.axes[axis].config
            high, low = counts_of_ns(config.steplen_ns), counts_of_ns(config.stepspace_ns)
            self._slow_enough &= high >= _CLK_WIDTH_COUNTS and high + low >= PERIOD

    def _has(self, axis: int, bit: Status) -> bool:
        return bool(self.board.firmware.nodes[axis].dictionary.get(od.STATUSWORD) & bit)

    # --- what must hold at any time

    def look(self) -> None:
        """Look at every axis and every queue, and compare with the look before."""
        motion = self.board.firmware.motion
        dt_ticks, self._tick = motion.tick - self._tick, motion.tick
        for axis, watch in enumerate(self.axes):
            made, rested = motion.axes[axis].counter_steps - watch.shift, not motion.axes[axis].running
            speed_max = motion.axes[axis].config.velocity_max_units_per_s
            watch.speed_max = speed_max if rested and not motion.axes[axis].queued else max(speed_max, watch.speed_max)
            if made != watch.made and watch.rested and not watch.given:
                raise BrokenInvariantError(f"axis {axis} sets off without a target of this enabling")
            if not (rested and watch.rested):
                self._look_at_motion(axis, watch, dt_ticks)
            watch.made = made
            watch.rested = rested or (watch.rested and not watch.given)  # a motion without a target has yet to show
        for fault in overfull(self.board):
            raise BrokenInvariantError(fault)

    def _look_at_motion(self, axis: int, watch: _AxisWatch, dt_ticks: int) -> None:
        motion, drive = self.board.firmware.motion, self.board.firmware.nodes[axis].drive
        if motion.axes[axis].running and not drive.energised:
            raise BrokenInvariantError(f"axis {axis} moves in {drive.state.name}")
        before, velocity = watch.velocity, motion.axes[axis].velocity * 1000 // 64
        watch.velocity = velocity
        if abs(velocity) > watch.speed_max + VELOCITY_ROUNDING:
            raise BrokenInvariantError(f"axis {axis} moves with {velocity} units/s")
        cut = not motion.axes[axis].running and not self._has(axis, Status.POSITION_KNOWN)
        if self.setup.steady_ramps and not cut and drive.mode_number not in _STREAMED:
            most = ACCELERATION * dt_ticks // _TICKS_PER_S + VELOCITY_ROUNDING
            if abs(velocity - before) > most:
                raise BrokenInvariantError(
                    f"axis {axis} goes from {before} to {velocity} units/s within {dt_ticks} ticks"
                )

    def look_closely(self) -> None:
        """Compare pins, counters and objects that must agree."""
        self.look()
        self.board.drain()
        motion = self.board.firmware.motion
        for axis, watch in enumerate(self.axes):
            made = motion.axes[axis].counter_steps - watch.shift
            if watch.pins.steps != made:
                raise BrokenInvariantError(f"axis {axis} has made {watch.pins.steps} steps and counted {made}")
            owed_units = abs(motion.axes[axis].demand_units - motion.axes[axis].counter_units)
            if owed_units > 16_384 * 9 // 16 // motion.axes[axis].config.microsteps + 1:
                raise BrokenInvariantError(f"axis {axis} is {owed_units} units behind its demand")
            node = self.board.firmware.nodes[axis]
            if State.of(node.dictionary.get(od.STATUSWORD)) is not node.drive.state:
                raise BrokenInvariantError(f"axis {axis}: the statusword does not say {node.drive.state.name}")

    def look_at_queues(self) -> None:
        """Look at everything on the board that could grow; this takes some milliseconds."""
        for fault in overgrown(self.board):
            raise BrokenInvariantError(fault)

    # --- what must hold over a whole session

    def close(self) -> None:
        """Judge the pins, the drivers and the size of everything at the end of a session."""
        self.look_closely()
        changes = self.board.pin_changes
        for axis, watch in enumerate(self.axes):
            faults = list(watch.pins.faults)
            own = [change for change in changes if change.axis == axis]
            for pin in (Pin.ENABLE, Pin.RESET):
                faults += level_faults(watch.pins.clk, own, pin, self.power_cycles)
            if self._slow_enough and not self.power_cycles:
                rules = self.board.trace(axis).violations.rules()
                faults += [rule.value for rule in rules if rule is not Rule.OVER_TEMPERATURE]
            if faults:
                raise BrokenInvariantError(f"axis {axis}: {'; '.join(faults[:3])}")
        self.look_at_queues()

    def traces(self) -> tuple[object, ...]:
        """Return every edge, pin change and frame, on which all repetitions must agree."""
        self.board.drain()
        edges = [(watch.pins.clk.tolist(), watch.pins.direction.tolist()) for watch in self.axes]
        pins: list[PinChange] = self.board.pin_changes
        return edges, pins, self.bus.log_counts.tolist(), self.bus.log_frames


def repeat(session: Session, kernel: Kernel, *, watched: bool) -> Machine:
    """Execute a session again, from its record."""
    machine = Machine(session.setup, kernel, watched=watched)
    for step in session.steps:
        machine.execute(step)
        if watched:
            machine.look_closely()
    return machine
