"""What can be said of a chip and its image at an instant: why it cannot go on, and what was not modelled."""

from dataclasses import dataclass
from typing import Any, Final

from steptwin.features.stm32.chip import cells as c
from steptwin.features.stm32.chip.engine import Stm32Chip
from steptwin.features.stm32.chip.registers import name_of
from steptwin.features.stm32.image import RAM_START, FlashImage

_REGISTERS: Final = ("r0", "r1", "r2", "r3", "r12", "sp", "lr", "xpsr")


def fault_sentence(chip: Stm32Chip, image: FlashImage) -> str:
    """Return why the processor cannot go on, with place and registers; empty while it can."""
    fault, at = chip.cells[c.FAULT], chip.cells[c.FAULT_AT]
    if not fault:
        return ""
    pc = chip.cells[c.FAULT_PC] or chip.cells[c.PC]
    if fault == c.FAULT_WATCHDOG:
        watchdog, why = ("WWDG", "refreshed too early or not") if at else ("IWDG", "not refreshed")
        return f"the watchdog {watchdog} resets the processor: it was {why}, {image.place(chip.cells[c.PC])}"
    if fault == c.FAULT_RESET:
        return f"the firmware resets the processor (SYSRESETREQ), {image.place(chip.cells[c.PC])}"
    if fault == c.FAULT_STACK:
        why = f"stack overflow: the stack is at 0x{at:08X}, but what it may use begins at 0x{chip.stack_limit:08X}"
    elif fault == c.FAULT_UNMAPPED and RAM_START - 0x1000 <= at < RAM_START and chip.register("sp") <= at + 0x100:
        why = f"stack overflow: the stack has left the RAM, which begins at 0x{RAM_START:08X}, by 0x{at:08X}"
    else:
        why = _why(fault, at)
    registers = " ".join(f"{name}=0x{chip.register(name):08X}" for name in _REGISTERS)
    return f"HardFault at {image.place(pc)}: {why}; {registers}"


def _why(fault: int, at: int) -> str:
    return {
        c.FAULT_UNMAPPED: f"there is nothing at 0x{at:08X}, or it cannot be written",
        c.FAULT_UNDEFINED: "the instruction is undefined, or not for this state of the processor",
        c.FAULT_BREAKPOINT: "a breakpoint (BKPT) without a debugger",
        c.FAULT_VECTOR: f"the vector of exception {at} is no Thumb code",
        c.FAULT_RETURN: f"a return from a handler (0x{at:08X}) outside of any",
        c.FAULT_UNICORN: f"unicorn cannot execute the instruction (its error {at})",
    }[fault]


_KINDS: Final = {
    c.STRANGE_READ: "read",
    c.STRANGE_WRITE: "write",
    c.STRANGE_NO_CLOCK: "access while its clock is off in RCC",
    c.STRANGE_BITS: "write of bits",
}


@dataclass(frozen=True, slots=True)
class StrangeAccess:
    """Accesses to one place whose effect the twin does not have.

    Attributes:
        name: name of the register or peripheral.
        address: where it is.
        kind: `read`, `write`, `write of bits` that are not modelled, or access without clock.
        times: number of accesses.
        first: the first instruction that made one, with function and line.
    """

    name: str
    address: int
    kind: str
    times: int
    first: str

    def to_dict(self) -> dict[str, Any]:
        """Return it for JSON."""
        return {
            "name": self.name,
            "address": f"0x{self.address:08X}",
            "kind": self.kind,
            "times": self.times,
            "first": self.first,
        }


def strange_accesses(chip: Stm32Chip, image: FlashImage) -> list[StrangeAccess]:
    """Return the accesses that are not modelled, in the order of the first ones."""
    found = []
    for number in range(chip.cells[c.STRANGE_COUNT]):
        place = c.STRANGE + c.STRANGE_FIELDS * number
        address, kind, times, pc = (chip.cells[place + i] for i in range(c.STRANGE_FIELDS))
        found.append(StrangeAccess(name_of(address), address, _KINDS[kind], times, image.place(pc)))
    return found
