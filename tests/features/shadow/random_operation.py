"""Operate a machine at random in virtual time, and let shadows hear it.

    python -m tests.features.shadow.random_operation ROBOT MINUTES SEED

What a shadow tells of it is a false alarm: the machine has no fault.
"""

import random
import sys
from collections.abc import Callable
from contextlib import suppress

from steptwin.controller.motion.backend import Kernel, fastest_kernel
from steptwin.host.common.errors import InputError
from steptwin.host.operate.homing import home_robot
from steptwin.host.operate.jogging import jog, step_joint
from steptwin.host.operate.moving import move
from steptwin.host.operate.session import Session
from steptwin.host.robots import load_robot
from steptwin.host.robots.joint import Joint
from steptwin.protocol import od
from tests.features.shadow.machines import Real, shadowed

JITTERS_US = (300, 1500)
PPM_MAX = 100.0
PAUSES_S = (0.0, 0.0, 0.05, 0.12, 0.2)
_TOKEN = 1
"""Under which the session is in charge: a random one changes the lengths of frames, and so the time of the run."""
_REACHED_S = 3.0
"""Time after which a relative move that still goes on is left to itself."""


class Operator:
    """Moves, jogs, steps, homes, and sends relative targets as a master of its own, one after the other."""

    def __init__(self, name: str, seed: int, kernel: Kernel) -> None:
        self.robot = load_robot(name)
        self.real = Real(self.robot, kernel)
        self.real.session = Session(self.real.board, self.robot, _TOKEN)
        self._draw = random.Random(seed)
        self._homed = [joint.name for joint in self.robot.joints if joint.homing is not None]

    def operate(self, minutes: float) -> None:
        """Do something at random until so much time has passed; rest at the end."""
        choices: list[Callable[[], None]] = [self.move, self.jog, self.jog, self.step]
        if all(len(self.robot.coupling.axes_moved_by(i)) == 1 for i in range(len(self.robot.joints))):
            choices.append(self.relative)  # a relative move of one motor alone would twist two that turn one joint
        self.home()
        while self.real.board.now_s() < 60 * minutes:
            action = self.home if self._draw.random() < 0.02 else self._draw.choice(choices)
            with suppress(InputError):  # a step leaves the limits, a jog begins while a relative move goes on
                action()
            self.real.board.wait(self._draw.choice((*PAUSES_S, self._draw.random())))
        self.real.board.wait(0.6)

    def home(self) -> None:
        home_robot(self.real.session, joints=self._homed, together=True)

    def move(self) -> None:
        whole = self._draw.random() < 0.3
        goal = [self._place(joint) if whole or self._draw.random() < 0.5 else None for joint in self.robot.joints]
        move(self.real.session, goal, speed_percent=self._draw.choice((10.0, 50.0, 100.0)))

    def _place(self, joint: Joint) -> float:
        return joint.lower + (joint.upper - joint.lower) * self._draw.uniform(0.2, 0.8)

    def jog(self) -> None:
        joint = self._draw.choice(self.robot.joints)
        speed = self._draw.choice((1, -1)) * self._draw.uniform(0.05, 1.0) * joint.speed_max
        jog(self.real.session, joint.name, speed, self._draw.uniform(0.02, 1.0))

    def step(self) -> None:
        joint = self._draw.choice(self.robot.joints)
        step_joint(self.real.session, joint.name, self._draw.uniform(-0.05, 0.05) * (joint.upper - joint.lower))

    def relative(self) -> None:
        axis = self._draw.choice(self.real.session.machine.axes)
        axis.enable()
        base = self._draw.choice((0, 1, 2))
        self.real.go_relative(axis, self._draw.randint(-40_000, 40_000), base, longest_s=_REACHED_S)
        axis.write(od.CONTROLWORD, 0x0F)
        axis.write(od.POSITIONING_OPTION, 0)


def false_alarms(name: str, minutes: float, seed: int, kernel: Kernel) -> dict[int, list[str]]:
    """Return what a shadow tells of a machine that is operated at random, by the greatest lateness of its stamps."""
    operator, draw = Operator(name, seed, kernel), random.Random(seed)
    operator.operate(minutes)
    alarms = {}
    for jitter_us in JITTERS_US:
        heard = operator.real.heard(jitter_us=jitter_us, ppm=draw.uniform(-PPM_MAX, PPM_MAX), seed=seed)
        told, _ = shadowed(operator.robot, heard, kernel)
        alarms[jitter_us] = [str(each) for each in told]
    return alarms


if __name__ == "__main__":
    robot_name, minutes_text, seed_text = sys.argv[1:]
    for late_us, lines in false_alarms(robot_name, float(minutes_text), int(seed_text), fastest_kernel()).items():
        sys.stdout.write(f"{robot_name}, stamps up to {late_us} us late: {len(lines)} false alarms\n")
        sys.stdout.writelines(f"{line}\n" for line in lines[:20])
