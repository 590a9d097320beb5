"""A logic analyser for tests: signals in seconds become files of the programs that people record with."""

import struct
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from steptwin.host.common.arrays import FloatArray, Int64Array
from steptwin.host.verify import Evidence
from steptwin.protocol.timer import COUNTS_PER_SECOND


class Probe(NamedTuple):
    """A signal: its name, its level at first and the instants of its changes."""

    name: str
    level: int
    times_s: FloatArray


def probes_of(evidence: Evidence) -> list[Probe]:
    """Return STEP and DIR of each axis of an emulated run."""
    probes: list[Probe] = []
    for axis in evidence.axes:
        edges = np.column_stack([axis.clk_rise_counts, axis.clk_fall_counts]).ravel()
        probes.append(Probe(f"D{len(probes)}", 0, edges / COUNTS_PER_SECOND))
        probes.append(Probe(f"D{len(probes)}", 0, axis.dir_edge_counts / COUNTS_PER_SECOND))
    return probes


def seen_by(probes: Sequence[Probe], ppm: float = 0.0, before_s: float = 0.0) -> list[Probe]:
    """Return the signals as an analyser sees them whose clock is off and which was started before."""
    return [probe._replace(times_s=probe.times_s * (1.0 + ppm * 1e-6) + before_s) for probe in probes]


def runs_of(probes: Sequence[Probe], rate_hz: float, tail_s: float = 0.01) -> tuple[Int64Array, Int64Array]:
    """Return the samples as runs of one value, probe k in bit k, and how long each lasts."""
    at = [np.ceil(probe.times_s * rate_hz).astype(np.int64) for probe in probes]
    bits = np.concatenate([np.full(each.size, 1 << bit) for bit, each in enumerate(at)])
    instants = np.concatenate(at)
    order = np.argsort(instants, kind="stable")
    first = sum(probe.level << bit for bit, probe in enumerate(probes))
    values = np.bitwise_xor.accumulate(np.concatenate(([first], bits[order])))
    end = int(instants.max(initial=0) + tail_s * rate_hz) + 2
    return values, np.diff(np.concatenate(([0], instants[order], [end])))


def write_session(path: Path, probes: Sequence[Probe], rate_hz: float, part_bytes: int = 4 << 20) -> Path:
    """Write a session file of sigrok."""
    unit = -(-len(probes) // 8)
    values, lasts = runs_of(probes, rate_hz)
    words = values.astype("<i8").view(np.uint8).reshape(-1, 8)[:, :unit]
    data = np.repeat(np.ascontiguousarray(words).view(f"V{unit}"), lasts).tobytes()
    names = "".join(f"probe{number}={probe.name}\n" for number, probe in enumerate(probes, 1))
    head = f"[global]\nsigrok version=0.5.2\n\n[device 1]\ncapturefile=logic-1\ntotal probes={len(probes)}\n"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as session:
        session.writestr("version", "2")
        session.writestr(
            "metadata", f"{head}samplerate={rate_hz / 1e6:.9g} MHz\ntotal analog=0\n{names}unitsize={unit}\n"
        )
        for number, begin in enumerate(range(0, len(data), part_bytes), 1):
            session.writestr(f"logic-1-{number}", data[begin : begin + part_bytes])
    return path


def rows_of(probes: Sequence[Probe]) -> list[tuple[float, list[int]]]:
    """Return a row for each instant at which something changes, and the first one."""
    instants = np.unique(np.concatenate([np.zeros(1), *(probe.times_s for probe in probes)]))
    levels = [(probe.level + np.searchsorted(probe.times_s, instants, side="right")) & 1 for probe in probes]
    return list(zip(instants.tolist(), np.column_stack(levels).tolist(), strict=True))


def write_changes(path: Path, probes: Sequence[Probe], head: str) -> Path:
    """Write a table with a row a change, under a head."""
    rows = (f"{at_s:.9f},{','.join(map(str, levels))}\n" for at_s, levels in rows_of(probes))
    path.write_text(head + "".join(rows), encoding="utf-8")
    return path


def write_saleae(folder: Path, probes: Sequence[Probe], end_s: float) -> Path:
    """Write Logic 2's binary export, a file for each probe."""
    folder.mkdir()
    for number, probe in enumerate(probes):
        head = struct.pack("<8siiIddQ", b"<SALEAE>", 0, 0, probe.level, 0.0, end_s, probe.times_s.size)
        (folder / f"digital_{number}.bin").write_bytes(head + probe.times_s.astype("<f8").tobytes())
    return folder
