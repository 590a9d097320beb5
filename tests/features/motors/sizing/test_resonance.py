"""The map of resonances: peaks where microsteps come at the natural frequency, and slips where full steps do."""

from dataclasses import replace

import numpy as np

from steptwin.features.motors.rotors.motor import CATALOGUE
from steptwin.features.motors.rotors.rotors import Drive
from steptwin.features.motors.sizing.fitting import natural_hz
from steptwin.features.motors.sizing.resonance import SETTINGS, Electrics, resonance_map

MOTOR = CATALOGUE["17HS19-2004S1"]
DRIVE = Drive(replace(MOTOR, detent_torque_nm=0.0, iron_drag_nm_s=0.003), 0.6)
WHEEL_KGM2 = 82e-7
ELECTRICS = Electrics(current_a=2.0, fast_decay=1.0, volt=24.0)


def test_eighths_swing_most_where_they_come_at_the_natural_frequency() -> None:
    peak_hz = natural_hz(DRIVE, 2.0, WHEEL_KGM2) / 8.0
    found = resonance_map(DRIVE, WHEEL_KGM2, ELECTRICS, peak_hz * np.array([0.8, 1.0, 1.25]))
    eighths = found.load_deg[SETTINGS.index(8)]
    assert eighths.argmax() == 1
    assert not found.slips[SETTINGS.index(8) :].any()
    finer = found.load_deg[SETTINGS.index(16)]
    assert finer.max() < eighths.max() < found.load_deg[SETTINGS.index(1)].max()


def test_full_steps_lose_steps_near_resonance_where_microsteps_lose_none() -> None:
    drive = Drive(MOTOR, 0.6, lower_rad=-1.0, upper_rad=1.0)  # end stops of the arm, which this wheel has none of
    found = resonance_map(drive, WHEEL_KGM2, ELECTRICS, np.array([170.0]))
    assert found.slips[:, 0].tolist() == [True, False, False, False]


def test_tenths_swing_most_where_they_come_at_the_natural_frequency() -> None:
    peak_hz = natural_hz(DRIVE, 2.0, WHEEL_KGM2) / 10.0
    rates_hz = peak_hz * np.array([0.8, 1.0, 1.25])
    found = resonance_map(DRIVE, WHEEL_KGM2, ELECTRICS, rates_hz, settings=(8, 10, 16))
    assert found.load_deg.shape == (3, 3)
    assert found.load_deg[1].argmax() == 1
