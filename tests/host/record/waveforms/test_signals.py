"""Check the signals of a run, and the drives' states from its bus log."""

from pathlib import Path

import numpy as np
import pytest

from steptwin.host.common.errors import InputError
from steptwin.host.record.waveforms import SignalKind, drive_states, everything, whole_record, wires
from steptwin.host.record.waveforms.signal import STATES
from steptwin.host.robots import load_robot
from steptwin.protocol.cia402 import State
from tests.host.verify.motions import ENABLE_COUNTS, START_COUNTS, expect, line, motion, perfect_evidence

PLAN = expect(motion(1.0, line(0.0, 100.0), line(5.0, -40.0)), 10.0, 10.0)
EVIDENCE = perfect_evidence(PLAN)

LOG = """\
(0000000000.000054) steptwin0 710#00
(0000000000.001000) steptwin0 190#40020000000000
(0000000000.002000) steptwin0 191#40020000000000
(0000000000.003500) steptwin0 190#27020700000000
(0000000000.004000) steptwin0 290#2702070000000000
(0000000000.005000) steptwin0 190#FFFF0700000000
(0000000000.006000) steptwin0 190#0802
(0000000001.000000) steptwin0 190#08020700000000
"""


def test_wires_of_an_axis() -> None:
    names = [signal.name for signal in wires(EVIDENCE)]
    assert names[:6] == ["a_step", "a_dir", "a_enable", "a_reset", "a_out1", "a_out2"]
    assert len(names) == 12
    assert all(signal.kind is SignalKind.WIRE for signal in wires(EVIDENCE))


def test_the_record_goes_from_power_up_to_the_last_edge() -> None:
    last = max(int(axis.clk_fall_counts[-1]) for axis in EVIDENCE.axes)
    window = whole_record(EVIDENCE)
    assert (window.from_counts, window.to_counts, window.start_counts) == (0, last, START_COUNTS)
    assert window.time_s(START_COUNTS) == 0.0
    assert window.counts(0.5) == START_COUNTS + 36_000_000


def log_file(folder: Path, text: str = LOG) -> Path:
    path = folder / "bus.log"
    path.write_text(text, encoding="ascii")
    return path


def test_states_are_those_of_the_statuswords(tmp_path: Path) -> None:
    """Other PDOs and PDOs of another length are ignored; bits that match no state make the state unknown."""
    first, second = drive_states(log_file(tmp_path), 2)
    changes = [(72_000, State.SWITCH_ON_DISABLED), (252_000, State.OPERATION_ENABLED), (72_000_000, State.FAULT)]
    counts, values = first.between(0, 10**9)
    told = [(c, STATES[v]) for c, v in zip(counts.tolist(), values.tolist(), strict=True)]
    assert told == [(c, s.name) for c, s in changes[:2]] + [(360_000, "UNKNOWN"), (72_000_000, "FAULT")]
    assert (first.at(0), second.at(10**9)) == (0, STATES.index("SWITCH_ON_DISABLED"))


@pytest.mark.parametrize("line", ["(1.5) can0 190#00", "(0000000000.000054) can0 190#0", "junk", "(0.000001) can0 19#"])
def test_a_log_in_another_format_is_refused(line: str, tmp_path: Path) -> None:
    path = log_file(tmp_path, LOG + line + "\n")
    with pytest.raises(InputError) as caught:
        drive_states(path, 2)
    assert str(caught.value) == f"{path}: line 9: is not in candump's format"


def test_everything_has_positions_in_steps_and_in_the_joints_unit(tmp_path: Path) -> None:
    robot = load_robot("hybrid-arm")
    moves = [line(0.0, 10.0), line(5.0, -4.0), line(0.0, 0.0), line(1.0, 0.0)]
    evidence = perfect_evidence(expect(motion(1.0, *moves), *robot.steps_per_unit))
    signals = {signal.name: signal for signal in everything(evidence, robot, drive_states(log_file(tmp_path), 4))}
    assert len(signals) == 4 * 18
    assert signals["a_drive_state"].texts == STATES
    axis, spu = evidence.axes[1], robot.steps_per_unit[1]
    end = axis.start_steps + int(axis.step_signs.sum())
    assert signals["b_steps"].changes.at(0) == axis.start_steps
    assert signals["b_steps"].changes.at(10**9) == end
    assert signals[f"b_position_{robot.joints[1].unit}"].changes.at(10**9) == end / spu
    assert signals["b_m1"].changes.at(10**9) == 0
    assert signals["a_enable"].changes.at(ENABLE_COUNTS) == 1
    np.testing.assert_array_equal(signals["b_steps"].changes.between(0, 10**9)[0], axis.step_counts)
