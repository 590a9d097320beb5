"""The board's inputs: a switch changes for the firmware with the tick after the driver's count has passed its edge."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from steptwin.controller.motion.backend import Kernel
from steptwin.controller.motion.board_motion import BoardMotion
from steptwin.controller.motion.kernel import TICK_COUNTS
from steptwin.emulator.board.board import Board, BoardConfig
from steptwin.emulator.board.inputs import BoardInputs
from steptwin.emulator.bus.can_bus import Bus
from steptwin.emulator.drivers.driver_bank import AxisTrace
from steptwin.emulator.drivers.driver_module import Module, fitted
from steptwin.emulator.drivers.limits import Rule
from steptwin.emulator.operations import InputOperation, Operation, Scheduled
from steptwin.emulator.simulation import Simulation
from steptwin.emulator.world.switches import WEIGHT_ONE, Switch, Travel
from steptwin.protocol import od
from steptwin.protocol.cia402 import DigitalInput, ErrorCode, State
from steptwin.protocol.drivers import Cooling, Coupler
from steptwin.protocol.drivers.tb6560 import THREE_AMP_MODULE, tb6560
from steptwin.protocol.frame import COB_SYNC, Frame
from steptwin.protocol.pvt import PvtRecord
from tests.compiled import on_sources_only, skip_if_compiled
from tests.controller.bench_board import BenchBoard
from tests.controller.modes.homing_bench import (
    ACCELERATION_STEPS_PER_S2,
    FAST_STEPS_PER_S,
    SLOW_STEPS_PER_S,
    HomingBench,
    Slider,
)
from tests.emulator.pins import CHIP, PERIOD, WIRES
from tests.emulator.simulations import MS, STEP
from tests.messages import refusing
from tests.one_example import one_example
from tests.operations import BoardTemperature, DriverProtect, EmergencyStop, StuckSwitch, Supply

NEGATIVE, POSITIVE, HOME = DigitalInput.NEGATIVE_LIMIT, DigitalInput.POSITIVE_LIMIT, DigitalInput.HOME
NONE = DigitalInput(0)
BY_DRIVERS_TICKS = 99 * PERIOD // TICK_COUNTS
"""Ticks in which no driver counts a hundred steps."""

Seen = list[tuple[int, list[DigitalInput]]]


def board_of(kernel: Kernel, axes: int, *switches: Switch, start: Sequence[int] = (), osc_pf: float = 330.0) -> Board:
    return Board(BoardConfig((Module(tb6560(osc_pf)),) * axes, switches=switches, start_substeps=tuple(start)), kernel)


def watched(board: Board) -> Seen:
    """Everything that the board's firmware is told of its inputs from now on, with the instant.

    It must be told at the start of a tick that has not been computed yet.
    """
    skip_if_compiled()
    seen: Seen = []
    tell = board.firmware.set_inputs

    def set_inputs(levels: Sequence[DigitalInput], now_counts: int) -> None:
        assert board.firmware.motion.tick * TICK_COUNTS == now_counts
        seen.append((now_counts, list(levels)))
        tell(levels, now_counts)

    board.firmware.set_inputs = set_inputs  # type: ignore[assignment, method-assign]
    return seen


def expected(board: Board, until_counts: int) -> Seen:
    """What the firmware must have been told, from the steps counted alone, tick by tick."""
    config = board.config
    start = config.start_substeps or (0,) * config.axis_count
    ticks = np.arange(until_counts // TICK_COUNTS + 1) * TICK_COUNTS
    places = [_places(board.trace(axis), ticks) + start[axis] for axis in range(config.axis_count)]
    closed = {switch: switch.closed_at(start[switch.axis], before=False) for switch in config.switches}
    told: Seen = [(-1, [NONE] * config.axis_count)]
    for i, counts in enumerate(ticks):
        levels = [NONE] * config.axis_count
        for switch, before in closed.items():
            closed[switch] = switch.closed_at(int(places[switch.axis][i]), before=before)
            if closed[switch]:
                levels[switch.axis] |= switch.input
        if levels != told[-1][1]:
            told.append((int(counts), levels))
    return told[1:]


def _places(trace: AxisTrace, ticks: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the driver's count at the start of each tick: the steps made before it."""
    sums = np.concatenate(([0], np.cumsum(trace.step_signs, dtype=np.int64)))
    return sums[np.searchsorted(trace.step_counts, ticks)]


def run(simulation: Simulation, motions: dict[int, list[PvtRecord]], until_ms: int) -> None:
    """Enable nodes, let them go through records, started with one SYNC."""
    simulation.send(Frame(0x000, b"\x01\x00"))
    for node, records in motions.items():
        for word in (0x06, 0x07, 0x0F):
            simulation.send(Frame(0x200 + node, bytes((word, 0, 7))))
        for record in records:
            simulation.send(Frame(0x500 + node, record.encode()))
        simulation.send(Frame(0x300 + node, b"\x1f\x00"))
    simulation.send(Frame(COB_SYNC, b""))
    simulation.run_until(until_ms * MS)


def records_through(points: list[tuple[int, int]]) -> list[PvtRecord]:
    """From rest to rest through positions in steps, each a number of ms after the previous one."""
    places = [0, *(place for place, _ in points)]
    return [
        PvtRecord((after - before) * STEP, 0, duration_ms, i)
        for i, ((before, after), (_, duration_ms)) in enumerate(zip(pairwise(places), points, strict=True))
    ]


POINTS = st.lists(st.tuples(st.integers(-120, 120), st.integers(40, 250)), min_size=1, max_size=6)
HOMES = st.tuples(st.integers(-80, 80), st.integers(0, 30), st.integers(0, 8))


class TestEdges:
    @pytest.mark.slow
    @settings(max_examples=30)
    @given(paths=st.tuples(POINTS, POINTS), homes=st.tuples(HOMES, HOMES), start=st.integers(-30, 30))
    def test_each_is_seen_in_its_tick(
        self,
        fast_kernel: Kernel,
        paths: tuple[list[tuple[int, int]], ...],
        homes: tuple[tuple[int, int, int], ...],
        start: int,
    ) -> None:
        switches = [Switch(axis, HOME, first, first + width, spare) for axis, (first, width, spare) in enumerate(homes)]
        board = board_of(fast_kernel, 3, *switches, start=(start, -start, 0))
        seen = watched(board)
        simulation = Simulation([board], Bus(1_000_000))
        motions = {0x10 + axis: records_through(path) for axis, path in enumerate(paths)}
        run(simulation, motions, until_ms=1_700)
        assert seen == expected(board, simulation.now_counts)

    @pytest.mark.parametrize("edge", range(700, 760))
    def test_at_full_speed(self, fast_kernel: Kernel, edge: int) -> None:
        """At 15 kHz an axis makes three or four steps a tick, and passes no switch unseen."""
        board = board_of(fast_kernel, 1, Switch(0, HOME, from_substeps=edge))
        seen = watched(board)
        simulation = Simulation([board], Bus(1_000_000))
        full = 15 * 64 * STEP
        ramp, cruise = PvtRecord(300 * STEP, full, 40, 0), PvtRecord(600 * STEP, full, 40, 1)
        run(simulation, {0x10: [ramp, cruise, PvtRecord(300 * STEP, 0, 40, 2)]}, 200)
        trace = board.trace(0)
        assert trace.step_counts[759] - trace.step_counts[699] == 60 * PERIOD
        assert [levels for _, levels in seen] == [[HOME]]
        assert seen[0][0] - TICK_COUNTS <= trace.step_counts[edge - 1] < seen[0][0]

    @pytest.mark.parametrize("edge", range(-4, 5))
    def test_a_pulse_that_has_to_wait_counts_in_the_tick_in_which_it_comes(
        self, fast_kernel: Kernel, edge: int
    ) -> None:
        """DIR must be stable for 255 us: after each turn the first rise comes a tick after its crossing."""
        board = board_of(fast_kernel, 1, Switch(0, HOME, from_substeps=edge))
        seen = watched(board)
        simulation = Simulation([board], Bus(1_000_000))
        simulation.send(Frame(0x610, bytes.fromhex("23012003") + (255_000).to_bytes(4, "little")))
        run(simulation, {0x10: records_through([(4, 40), (-5, 44), (4, 38), (-4, 43), (5, 41), (0, 60)])}, 400)
        assert states(board) == [State.OPERATION_ENABLED]
        assert board.firmware.motion.axes[0].delayed_steps > 3
        assert len(seen) >= 3
        assert seen == expected(board, simulation.now_counts)

    def test_on_two_boards_that_move_together(self, fast_kernel: Kernel) -> None:
        config = BoardConfig((WIRES,), switches=(Switch(0, HOME, 20, 30), Switch(0, POSITIVE, 60)))
        second = BoardConfig((WIRES,), first_node_id=0x11, switches=(Switch(0, HOME, -9, -3, 2),))
        boards = [Board(config, fast_kernel), Board(second, fast_kernel)]
        seen = [watched(board) for board in boards]
        simulation = Simulation(boards, Bus(1_000_000))
        there_and_back = records_through([(50, 60), (-20, 70), (10, 200)])
        run(simulation, {0x10: there_and_back, 0x11: there_and_back}, 500)
        for board, told in zip(boards, seen, strict=True):
            assert len(told) >= 4
            assert told == expected(board, simulation.now_counts)

    def test_one_that_is_closed_at_the_start_is_seen_at_once(self, fast_kernel: Kernel) -> None:
        board = board_of(fast_kernel, 2, Switch(1, NEGATIVE, to_substeps=-100), start=(0, -100))
        seen = watched(board)
        Simulation([board], Bus(1_000_000)).run_until(MS)
        assert seen == [(0, [NONE, NEGATIVE])]

    @pytest.mark.parametrize(
        ("method", "home"), [(17, (-20, 30)), (18, (-20, 30)), (20, (10, None)), (21, (None, 10)), (26, (-20, 30))]
    )
    @pytest.mark.parametrize(
        "start", [-640, pytest.param(-21, marks=pytest.mark.slow), 0, 11, pytest.param(300, marks=pytest.mark.slow)]
    )
    def test_a_homing_goes_as_on_the_bench(
        self, fast_kernel: Kernel, method: int, home: tuple[int | None, int | None], start: int
    ) -> None:
        """The same pulses and frames, to the count, as on a bench that looks at its switches in every tick."""
        switches = [
            Switch(0, NEGATIVE, to_substeps=-600),
            Switch(0, POSITIVE, from_substeps=600),
            Switch(0, HOME, *home),
        ]
        bench = HomingBench(
            fast_kernel,
            Slider(start, {switch.input: lambda p, s=switch: s.closed_at(p, before=False) for switch in switches}),  # type: ignore[misc]
        )
        bench.home(method)
        bench.wait(50)
        board = board_of(fast_kernel, 1, *switches, start=(start,))
        seen = watched(board)
        twin = BoardBench(fast_kernel, board)
        twin.home(method, until=bench.now)
        rises = board.trace(0).clk_rise_counts
        assert list(rises) == [rise for rise, _ in bench.rises]
        assert [(counts, levels[0]) for counts, levels in seen] == bench.edges
        assert twin.sent == bench.sent

    @pytest.mark.parametrize("microsteps", [1, 2, 8, 16])
    @pytest.mark.parametrize("module", [False, True], ids=["pins", "switches"])
    def test_they_stand_where_they_are_in_every_mode(
        self, fast_kernel: Kernel, microsteps: int, *, module: bool
    ) -> None:
        """The switch closes after 3 full steps, whether the driver's mode is that of its pins or of its module.

        The firmware counts with the pins' mode. It takes the module's 16 steps for the way of `microsteps` of them.
        """
        driver = fitted(THREE_AMP_MODULE, microsteps) if module else WIRES
        config = BoardConfig(switches=(Switch(0, HOME, from_substeps=48),), modules=(driver,))
        board = Board(config, fast_kernel)
        seen = watched(board)
        simulation = Simulation([board], Bus(1_000_000))
        firmware = 16 if module else microsteps
        simulation.send(Frame(0x610, bytes((0x2F, 0x00, 0x20, 0x01, firmware, 0, 0, 0))))
        run(simulation, {0x10: [PvtRecord(4 * 16_384 * microsteps // firmware, 0, 200, 0)]}, 400)
        assert board.driver_microsteps(0) == microsteps
        assert board.position_steps(0) == 4 * microsteps
        assert board.position_full_steps(0) == 4
        reached_counts = board.trace(0).step_counts[3 * microsteps - 1]
        assert [levels for _, levels in seen] == [[HOME]]
        latest_ticks = 2 if module else 1  # a module's DIR must have been stable for a while before a step is certain
        assert 0 < seen[0][0] - reached_counts <= latest_ticks * TICK_COUNTS

    def test_a_mode_with_longer_steps_is_known_at_the_start(self, fast_kernel: Kernel) -> None:
        """A switch that is seconds away in substeps is reached in a fraction of a second by full steps."""
        board = board_of(fast_kernel, 1, Switch(0, POSITIVE, from_substeps=6_400))
        seen = watched(board)
        simulation = Simulation([board], Bus(1_000_000))
        run(simulation, {0x10: records_through([(10, 40)])}, 60)
        simulation.send(Frame(0x210, bytes((0x00, 0, 7))))
        simulation.send(Frame(0x610, bytes((0x2F, 0x00, 0x20, 0x01, 1, 0, 0, 0))))
        sync_counts = simulation.now_counts
        run(simulation, {0x10: [PvtRecord(450 * 16_384, 0, 250, 1)]}, 500)
        steps = board.trace(0).step_counts
        reached_counts = steps[steps > sync_counts][399]  # from 10 substeps; the reset of the mode moves nothing
        assert [levels for _, levels in seen][:1] == [[POSITIVE]]
        assert seen[0][0] - TICK_COUNTS <= reached_counts < seen[0][0]

    @on_sources_only
    def test_far_away_they_cost_nothing(self, fast_kernel: Kernel, monkeypatch: pytest.MonkeyPatch) -> None:
        """How often the motion is asked to go on: no oftener for switches that are not near."""
        calls: list[int] = []
        advance = BoardMotion.advance

        def counting(motion: BoardMotion, until_tick: int) -> int:
            calls.append(until_tick)
            return advance(motion, until_tick)

        monkeypatch.setattr(BoardMotion, "advance", counting)
        asked = []
        for switches in ((), (Switch(0, POSITIVE, 10**6), Switch(1, NEGATIVE, to_substeps=-(10**6)))):
            calls.clear()
            board = board_of(fast_kernel, 2, *switches)
            records = records_through([(500, 250), (-500, 250), (500, 250)])
            run(Simulation([board], Bus(1_000_000)), {0x10: records, 0x11: records}, 2_000)
            asked.append(len(calls))
        assert asked[0] == asked[1]


class Rotor(NamedTuple):
    """One rotor's motion as inputs ask for it."""

    running: bool
    quiet: int
    undrained_pulses: int

    def quiet_ticks(self, steps: int) -> int:
        assert steps >= 1
        return self.quiet


class Rotors:
    """A motion as inputs ask for it: of each rotor, its quiet ticks, None while it stands, and its pulses ahead."""

    tick, starts = 100, 1

    def __init__(self, quiet_ticks: Sequence[int | None], pulses: int = 0) -> None:
        self.axes = [Rotor(each is not None, each or 0, pulses * (i + 1)) for i, each in enumerate(quiet_ticks)]


@on_sources_only
@pytest.mark.parametrize(
    ("quiet_ticks", "pulses", "read_in_ticks"),
    [
        ((90, 80, 70), 0, 70),  # the first of all that run
        ((None, 80, 90), 0, 80),
        ((90, None, None), 0, 90),
        ((90, 0, 80), 0, BY_DRIVERS_TICKS),  # one may make a step at once, but no driver counts a hundred so soon
        ((0, None, 90), 0, BY_DRIVERS_TICKS),
        ((90, 80, BY_DRIVERS_TICKS - 1), 0, BY_DRIVERS_TICKS),
        ((90, 80, BY_DRIVERS_TICKS + 1), 0, BY_DRIVERS_TICKS + 1),
        ((90, 80, 70), 20, 70),
        ((0, 0, 0), 32, 1),  # the third rotor has 96 pulses ahead: 4 steps are left, and 3 periods are less than a tick
        ((90, 80, 70), 33, 70),
        ((90, 80, 70), 34, 1),  # 102 pulses ahead: a switch may have changed
    ],
)
def test_the_first_rotor_that_may_reach_a_switch_says_when_it_is_read_again(
    quiet_ticks: tuple[int | None, ...], pulses: int, read_in_ticks: int
) -> None:
    """A way of three rotors with weights of 1, whose steps are a substep: the switch is 300 of them away."""
    switch = Switch(0, HOME, from_substeps=300)
    way = Travel(tuple((rotor, WEIGHT_ONE) for rotor in range(3)))
    inputs = BoardInputs([switch], [0, 0, 0], [way, Travel.of_rotor(1), Travel.of_rotor(2)], PERIOD)
    motion: Any = Rotors(quiet_ticks, pulses)
    assert inputs.due_tick(motion) == motion.tick
    inputs.look(motion)
    assert inputs.due_tick(motion) == motion.tick + read_in_ticks


class BoardBench(BenchBoard):
    """A bench with a whole board: pulses go to its drivers, frames go without a bus."""

    def __init__(self, kernel: Kernel, board: Board) -> None:
        super().__init__(kernel)
        self.board, self.firmware = board, board.firmware
        board.boot(0)
        self.wait(1)
        self.enable(6)
        self.write(od.HOMING_SEARCH_SPEED, FAST_STEPS_PER_S * STEP)
        self.write(od.HOMING_ZERO_SPEED, SLOW_STEPS_PER_S * STEP)
        self.write(od.HOMING_ACCELERATION, ACCELERATION_STEPS_PER_S2 * STEP)

    def wait(self, dt_ms: float) -> None:
        until = self.now + round(dt_ms * MS)
        while self.now < until:
            due = self.firmware.next_due_counts
            self.now = self.board.advance(until if due is None else max(self.now, min(until, due)))
            self.firmware.poll(self.now)
            self._fetch()

    def home(self, method: int, until: int) -> None:
        for address, value in (
            (od.CONTROLWORD, 0x0F),
            (od.HOMING_METHOD, method),
            (od.HOME_OFFSET, 0),
            (od.CONTROLWORD, 0x1F),
        ):
            self.write(address, value)
        self.wait((until - self.now) / MS)


def enabled(board: Board, *schedule: Scheduled) -> Simulation:
    """A simulation with all of the board's axes in OPERATION ENABLED at 10 ms."""
    simulation = Simulation([board], Bus(1_000_000), schedule)
    switch_on(simulation, board)
    simulation.run_until(10 * MS)
    assert states(board) == [State.OPERATION_ENABLED] * board.config.axis_count
    return simulation


def states(board: Board) -> list[State]:
    return [node.drive.state for node in board.firmware.nodes]


def errors(board: Board) -> list[int]:
    return [node.dictionary.get(od.ERROR_CODE) for node in board.firmware.nodes]


class TestOperations:
    def test_all_axes_see_the_emergency_stop_with_the_next_tick(self, fast_kernel: Kernel) -> None:
        board = board_of(fast_kernel, 3)
        simulation = enabled(board)
        simulation.run_until(simulation.now_counts + 1234)
        seen = watched(board)
        simulation.operate(EmergencyStop(pressed=True))
        assert states(board) == [State.OPERATION_ENABLED] * 3
        tick = -(-simulation.now_counts // TICK_COUNTS) * TICK_COUNTS
        simulation.run_until(tick)
        assert seen == [(tick, [DigitalInput.ESTOP] * 3)]
        assert (states(board), errors(board)) == ([State.FAULT] * 3, [ErrorCode.ESTOP] * 3)
        simulation.operate(EmergencyStop(pressed=False))
        simulation.run_until(tick + 10 * MS)
        assert seen[1:] == [(tick, [NONE] * 3)]

    def test_at_the_start_of_a_tick_it_is_seen_at_once(self, fast_kernel: Kernel) -> None:
        board = board_of(fast_kernel, 1)
        simulation = enabled(board)
        assert simulation.now_counts % TICK_COUNTS == 0
        simulation.operate(EmergencyStop(pressed=True))
        assert states(board) == [State.FAULT]

    def test_protect_is_one_drivers(self, fast_kernel: Kernel) -> None:
        board = board_of(fast_kernel, 2)
        simulation = enabled(board)
        simulation.operate(DriverProtect(1, active=True))
        simulation.run_until(simulation.now_counts + MS)
        assert (states(board), errors(board)) == (
            [State.OPERATION_ENABLED, State.FAULT],
            [ErrorCode.NONE, ErrorCode.TEMPERATURE],
        )
        assert board.firmware.nodes[1].dictionary.get(od.DIGITAL_INPUTS) == DigitalInput.DRIVER_PROTECT

    @pytest.mark.parametrize(
        ("operation", "code"),
        [
            (Supply(999), ErrorCode.UNDERVOLTAGE),
            (Supply(1000), ErrorCode.NONE),
            (Supply(3400), ErrorCode.NONE),
            (Supply(3401), ErrorCode.OVERVOLTAGE),
            (BoardTemperature(850), ErrorCode.NONE),
            (BoardTemperature(851), ErrorCode.TEMPERATURE),
        ],
    )
    def test_measured_values_count_at_once(self, fast_kernel: Kernel, operation: Operation, code: ErrorCode) -> None:
        board = board_of(fast_kernel, 1)
        simulation = enabled(board)
        simulation.operate(operation)
        assert errors(board) == [code]

    def test_supply_and_temperature_are_kept_apart(self, fast_kernel: Kernel) -> None:
        board = board_of(fast_kernel, 1)
        simulation = enabled(board)
        simulation.operate(Supply(1200))
        simulation.operate(BoardTemperature(400))
        dictionary = board.firmware.nodes[0].dictionary
        assert (dictionary.get(od.BOARD_TEMPERATURE), dictionary.get(od.SUPPLY_VOLTAGE)) == (400, 1200)

    @pytest.mark.parametrize("ends_closed", [False, True])
    def test_a_stuck_switch_hides_its_edges_until_it_is_free(self, fast_kernel: Kernel, ends_closed: bool) -> None:
        """It goes on following the axis: once free, it depends on the way, by its hysteresis. Others are as always."""
        board = board_of(fast_kernel, 2, Switch(0, HOME, 20, 30, 2), Switch(1, HOME, from_substeps=10))
        seen = watched(board)
        stick = [StuckSwitch(0, HOME, closed) for closed in (True, False, None)]
        schedule = [Scheduled(at_ms * MS, each) for at_ms, each in zip((5, 6, 400), stick, strict=True)]
        simulation = Simulation([board], Bus(1_000_000), schedule)
        there = records_through([(50, 100), (30 if ends_closed else 31, 100), (31, 20)])
        run(simulation, {0x10: there, 0x11: records_through([(20, 100)])}, 399)
        assert [levels[0] for counts, levels in seen if counts < 7 * MS] == [HOME, NONE]
        assert [levels for _, levels in seen[2:]] == [[NONE, HOME]]
        assert board.environment.axes[0].stuck == HOME
        simulation.run_until(401 * MS)
        assert seen[3:] == ([(400 * MS, [HOME, HOME])] if ends_closed else [])
        assert board.environment.axes[0].stuck == NONE

    def test_an_axis_stops_at_a_limit_switch_that_sticks_closed_under_way(self, fast_kernel: Kernel) -> None:
        board = board_of(fast_kernel, 1, Switch(0, POSITIVE, from_substeps=1_000))
        simulation = Simulation([board], Bus(1_000_000), [Scheduled(60 * MS, StuckSwitch(0, POSITIVE, closed=True))])
        run(simulation, {0x10: records_through([(60, 100)])}, 200)
        assert (states(board), errors(board)) == ([State.FAULT], [ErrorCode.LIMIT_SWITCH])
        assert 0 < board.position_steps(0) < 60

    def test_a_schedule_is_kept_to_the_count(self, fast_kernel: Kernel) -> None:
        """In order of time, the first of two at the same instant first; what the bus does meanwhile changes nothing."""
        pressed, released = EmergencyStop(pressed=True), EmergencyStop(pressed=False)
        board = board_of(fast_kernel, 1)
        simulation = enabled(
            board,
            Scheduled(30 * MS + 1, pressed),
            Scheduled(20 * MS, pressed),
            Scheduled(20 * MS, released),
            Scheduled(25 * MS + 17_999, Supply(900)),
        )
        seen = watched(board)
        simulation.run_until(25 * MS + 17_998)
        assert (seen, errors(board)) == ([], [ErrorCode.NONE])
        simulation.run_until(25 * MS + 17_999)
        assert errors(board) == [ErrorCode.UNDERVOLTAGE]
        simulation.run_until(40 * MS)
        assert seen == [(30 * MS + TICK_COUNTS, [DigitalInput.ESTOP])]

    def test_each_board_has_its_own(self, fast_kernel: Kernel) -> None:
        boards = [
            Board(BoardConfig((WIRES,)), fast_kernel),
            Board(BoardConfig((WIRES,), first_node_id=0x11), fast_kernel),
        ]
        simulation = Simulation(boards, Bus(1_000_000), [Scheduled(5 * MS, EmergencyStop(pressed=True), board=1)])
        seen = [watched(board) for board in boards]
        simulation.run_until(6 * MS)
        simulation.operate(DriverProtect(0, active=True))
        simulation.run_until(7 * MS)
        assert seen == [[(6 * MS, [DigitalInput.DRIVER_PROTECT])], [(5 * MS, [DigitalInput.ESTOP])]]


CRUMB = Module(CHIP, cooling=Cooling(resistance_k_per_w=200, capacity_j_per_k=1e-4))
"""A chip that goes to 300 degC with a time constant of 20 ms: 170 degC after 15 ms, down to 150 degC in 3 ms."""


class TestHeat:
    @pytest.fixture
    def board(self, fast_kernel: Kernel) -> Board:
        return Board(BoardConfig(modules=(CRUMB, WIRES)), fast_kernel)

    @pytest.mark.parametrize("late_counts", [0, 1, 17_999])
    @pytest.mark.parametrize("moving", [False, True])
    def test_protect_is_seen_with_the_next_tick(self, board: Board, late_counts: int, moving: bool) -> None:
        """Whether or not many ticks are computed at a time."""
        seen = watched(board)
        simulation = Simulation([board], Bus(1_000_000))
        simulation.run_until(late_counts)
        begun_counts = simulation.now_counts
        if moving:
            run(simulation, {0x10: records_through([(200, 250)]), 0x11: records_through([(200, 250)])}, 250)
        else:
            switch_on(simulation, board)
            simulation.run_until(250 * MS)
        (hot_counts,) = board.trace(0).violations.counts.tolist()
        assert hot_counts == pytest.approx(begun_counts + 15 * MS, abs=2 * MS)
        assert seen == [(-(-hot_counts // TICK_COUNTS) * TICK_COUNTS, [DigitalInput.DRIVER_PROTECT, NONE])]
        assert (states(board)[0], errors(board)[0]) == (State.FAULT, ErrorCode.TEMPERATURE)
        emcy_counts = [
            counts
            for counts, frame in zip(simulation.bus.log_counts, simulation.bus.log_frames, strict=True)
            if frame.cob_id == 0x090 and frame.data.startswith(bytes.fromhex("1043"))
        ]
        assert [counts - seen[0][0] < MS for counts in emcy_counts] == [True]

    @pytest.mark.parametrize(("cooling_ms", "over"), [(1, False), (10, True)])
    def test_reset_ends_it_once_the_chip_is_cooler(self, board: Board, cooling_ms: int, over: bool) -> None:
        """RESET goes low with another number of microsteps."""
        simulation = Simulation([board], Bus(1_000_000))
        switch_on(simulation, board)
        simulation.run_until(14 * MS)
        while states(board)[0] is not State.FAULT:
            simulation.run_until(simulation.now_counts + MS // 10)
        simulation.run_until(simulation.now_counts + cooling_ms * MS)
        simulation.send(Frame(0x610, bytes.fromhex("2f00200108000000")))
        simulation.run_until(simulation.now_counts + MS)
        assert board.firmware.nodes[0].dictionary.get(od.DIGITAL_INPUTS) == (0 if over else DigitalInput.DRIVER_PROTECT)
        simulation.send(Frame(0x210, b"\x80\0\7"))
        assert states(board)[0] is (State.SWITCH_ON_DISABLED if over else State.FAULT)

    @pytest.mark.parametrize("late_counts", [0, 1, 9_000, 17_999])
    def test_so_does_a_power_cycle(self, board: Board, late_counts: int) -> None:
        simulation = Simulation([board], Bus(1_000_000))
        switch_on(simulation, board)
        simulation.run_until(100 * MS + late_counts)
        assert board.firmware.nodes[0].dictionary.get(od.DIGITAL_INPUTS) == DigitalInput.DRIVER_PROTECT
        simulation.power_cycle()
        seen = watched(board)
        simulation.run_until(102 * MS)
        assert seen == []
        assert board.firmware.nodes[0].dictionary.get(od.DIGITAL_INPUTS) == 0
        switch_on(simulation, board)
        simulation.run_until(200 * MS)
        assert board.trace(0).violations.counts.size == 2

    @pytest.mark.parametrize("late_counts", [0, 1, 9_000, 17_999])
    def test_a_cold_one_stays_high_through_a_power_cycle(self, board: Board, late_counts: int) -> None:
        """Also if the chip warms up so fast that it is looked at in every tick."""
        simulation = Simulation([board], Bus(1_000_000))
        seen = [watched(board)]
        for cycle in range(1, 5):
            simulation.run_until(cycle * 7 * MS + late_counts)
            simulation.power_cycle()
            seen.append(watched(board))
        simulation.run_until(40 * MS)
        assert seen == [[]] * 5

    def test_on_two_boards_of_which_one_moves(self, board: Board, fast_kernel: Kernel) -> None:
        """The board at rest gets hot, and its firmware sees it in time."""
        mover = Board(BoardConfig((WIRES,), first_node_id=0x20), fast_kernel)
        simulation = Simulation([mover, board], Bus(1_000_000))
        seen = watched(board)
        switch_on(simulation, board)
        run(simulation, {0x20: records_through([(300, 250)])}, 250)
        (hot_counts,) = board.trace(0).violations.counts.tolist()
        assert [counts for counts, _ in seen] == [-(-hot_counts // TICK_COUNTS) * TICK_COUNTS]
        assert mover.trace(0).position_steps == 300

    def test_a_pin_that_is_held_low_stays_low(self, board: Board) -> None:
        simulation = Simulation([board], Bus(1_000_000), [Scheduled(5 * MS, DriverProtect(1, active=True))])
        switch_on(simulation, board)
        simulation.run_until(100 * MS)
        levels = [node.dictionary.get(od.DIGITAL_INPUTS) for node in board.firmware.nodes]
        assert levels == [DigitalInput.DRIVER_PROTECT] * 2

    def test_modules_have_no_terminal_for_it(self, fast_kernel: Kernel) -> None:
        coupled = replace(CRUMB, clk=Coupler(100, 100))
        board = Board(BoardConfig(modules=(coupled,)), fast_kernel)
        simulation = Simulation([board], Bus(1_000_000))
        switch_on(simulation, board)
        simulation.run_until(100 * MS)
        assert board.trace(0).violations.rules() == [Rule.OVER_TEMPERATURE]
        assert states(board) == [State.OPERATION_ENABLED]


def switch_on(simulation: Simulation, board: Board) -> None:
    """All axes to OPERATION ENABLED, at once."""
    simulation.send(Frame(0x000, b"\x01\x00"))
    for node in board.firmware.nodes:
        for word in (0x06, 0x07, 0x0F):
            simulation.send(Frame(0x200 + node.node_id, bytes((word, 0, 7))))


def monitored(board: Board) -> list[int]:
    """Rotor steps, lost steps, violations."""
    return [
        board.firmware.nodes[0].dictionary.get(address)
        for address in (od.ROTOR_POSITION_STEPS, od.LOST_STEPS, od.DRIVER_VIOLATIONS)
    ]


class TestMonitor:
    def test_it_counts_what_the_driver_counts(self, fast_kernel: Kernel) -> None:
        board = board_of(fast_kernel, 1)
        run(Simulation([board], Bus(1_000_000)), {0x10: records_through([(50, 60), (-20, 70)])}, 300)
        assert monitored(board) == [-20, 0, 0]

    def test_pulses_too_short_are_lost_and_show_as_following_error(self, fast_kernel: Kernel) -> None:
        """With 1000 pF a pulse must last 90 us; the board makes 33 us."""
        board = board_of(fast_kernel, 1, osc_pf=1000.0)
        run(Simulation([board], Bus(1_000_000)), {0x10: records_through([(50, 60), (-20, 70)])}, 300)
        assert monitored(board) == [0, -20, 120]
        assert board.firmware.nodes[0].dictionary.get(od.FOLLOWING_ERROR_ACTUAL) == -20 * STEP

    def test_a_power_cycle_resets_the_counts(self, fast_kernel: Kernel) -> None:
        board = board_of(fast_kernel, 1, osc_pf=1000.0)
        simulation = Simulation([board], Bus(1_000_000))
        run(simulation, {0x10: records_through([(50, 60)])}, 300)
        simulation.power_cycle()
        assert monitored(board) == [0, 0, 0]


class TestPowerCycle:
    def test_the_machine_stays_as_it_is(self, fast_kernel: Kernel) -> None:
        """Its position, switches, button and supply stay, and the new firmware sees them."""
        board = board_of(fast_kernel, 1, Switch(0, HOME, 45, 60))
        simulation = Simulation([board], Bus(1_000_000))
        run(simulation, {0x10: records_through([(50, 60)])}, 300)
        simulation.operate(Supply(2000))
        simulation.operate(EmergencyStop(pressed=True))
        simulation.run_until(301 * MS + 5)
        simulation.power_cycle()
        dictionary = board.firmware.nodes[0].dictionary
        assert (dictionary.get(od.DIGITAL_INPUTS), dictionary.get(od.SUPPLY_VOLTAGE)) == (0, 2000)
        simulation.run_until(302 * MS)
        assert dictionary.get(od.DIGITAL_INPUTS) == HOME | DigitalInput.ESTOP

    def test_the_next_motion_is_followed_past_the_switches(self, fast_kernel: Kernel) -> None:
        """The new firmware counts this motion as its first, as the old firmware did before the power cycle."""
        board = board_of(fast_kernel, 1, Switch(0, HOME, 70, 80))
        simulation = Simulation([board], Bus(1_000_000))
        run(simulation, {0x10: records_through([(50, 60)])}, 300)
        simulation.power_cycle()
        run(simulation, {0x10: records_through([(25, 60)])}, 600)
        assert board.firmware.nodes[0].dictionary.get(od.DIGITAL_INPUTS) == HOME

    def test_a_motion_cut_short_leaves_the_switches_where_the_axis_is(self, fast_kernel: Kernel) -> None:
        board = board_of(fast_kernel, 1, Switch(0, HOME, 20, 30))
        simulation = Simulation([board], Bus(1_000_000))
        run(simulation, {0x10: records_through([(50, 250)])}, 120)
        simulation.power_cycle()
        simulation.run_until(121 * MS)
        closed = 20 <= board.trace(0).position_steps <= 30
        assert board.firmware.nodes[0].dictionary.get(od.DIGITAL_INPUTS) == (HOME if closed else 0)
        assert closed


class TestGeneralInputs:
    """IN1 and IN2 are the host's: the board reports them at once and does nothing else."""

    def test_each_axis_has_its_own(self, fast_kernel: Kernel) -> None:
        simulation = Simulation([board_of(fast_kernel, 2)], Bus(1_000_000))
        simulation.run_until(10 * MS)
        nodes = simulation.boards[0].firmware.nodes

        def levels() -> list[int]:
            simulation.run_until(simulation.now_counts + MS)
            return [node.dictionary.get(od.DIGITAL_INPUTS) for node in nodes]

        simulation.operate(InputOperation(1, DigitalInput.IN1, on=True))
        simulation.operate(InputOperation(1, DigitalInput.IN2, on=True))
        assert levels() == [0, 0x000C_0000]
        simulation.operate(InputOperation(1, DigitalInput.IN1, on=False))
        assert levels() == [0, DigitalInput.IN2]
        assert [State.of(node.dictionary.get(od.STATUSWORD)) for node in nodes] == [State.SWITCH_ON_DISABLED] * 2
        simulation.power_cycle()
        nodes = simulation.boards[0].firmware.nodes
        assert levels() == [0, DigitalInput.IN2]  # the sensor has not moved

    def test_a_change_is_reported_by_itself(self, fast_kernel: Kernel) -> None:
        """TPDO4 carries the inputs; its event is their change."""
        bus = Bus(1_000_000)
        simulation = Simulation([board_of(fast_kernel, 1)], bus)
        simulation.send(Frame(0x000, b"\x01\x00"))
        simulation.run_until(100 * MS)
        simulation.schedule([Scheduled(120 * MS, InputOperation(0, DigitalInput.IN2, on=True))])
        simulation.run_until(130 * MS)
        sent = [(counts, frame.data[:4]) for counts, frame in zip(bus.log_counts, bus.log_frames, strict=True)
                if frame.cob_id == 0x490]  # fmt: skip
        counts, inputs = sent[-1]
        assert inputs == int(DigitalInput.IN2).to_bytes(4, "little")
        assert 0 <= counts - 120 * MS < 2 * TICK_COUNTS

    def test_other_inputs_cannot_be_set(self) -> None:
        with refusing(ValueError):
            InputOperation(0, HOME, on=True)


def test_edges_on_two_paths_are_seen_in_their_ticks(fast_kernel: Kernel) -> None:
    paths = ([(100, 60), (-40, 50)], [(-90, 60), (80, 60), (0, 40)])
    one_example(
        TestEdges.test_each_is_seen_in_its_tick,
        TestEdges(), fast_kernel, paths=paths, homes=((-20, 30, 3), (40, 0, 8)), start=7,
    )  # fmt: skip
