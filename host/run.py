"""One run from plan to verdict: check, start the board, stream, wait for the end, verify."""

import time
from collections.abc import Callable
from dataclasses import dataclass

from controller.backend import KERNELS, Kernel, fastest_kernel
from host.client import AxisRecords, AxisSettings, Machine
from host.embedded import EmbeddedBoard
from host.errors import DeviceFaultError, InputError
from host.kinematics import make_kinematics
from host.planner import Plan, check_start
from host.robot import Robot
from host.verify import Comparison, Report, RunInfo, compare, verify_comparison
from host.verify import Plan as VerifierPlan
from protocol.frame import Frame
