"""Harms to the host, the program that drives the machine; only scenarios ask for them."""

from collections.abc import Mapping
from typing import Final

from steptwin.host.common.control import Do
from steptwin.host.common.errors import InputError
from steptwin.host.common.tables import number_from
from steptwin.host.faults.bus_harms import FOREVER_S
from steptwin.host.faults.harms import HarmKind, HostFault, HostFaultKind, Writer
from steptwin.host.robots.robot import Robot


def _host_fault(_robot: Robot, how: HostFaultKind, by_s: float | None) -> HostFault:
    try:
        return HostFault(how, by_s or 0.0)
    except ValueError as error:
        raise InputError(str(error)) from error


KINDS: Final[Mapping[Do, HarmKind]] = {
    Do.HOST: HarmKind(
        _host_fault,
        {"how": lambda table, key: table.choice(key, HostFaultKind), "by_s": number_from(0, FOREVER_S, "s")},
    ),
}
WRITERS: Final[Mapping[type, Writer]] = {
    HostFault: lambda _, harm: {"do": Do.HOST, "how": harm.kind, "by_s": harm.by_s},
}
