"""The places of a chip's state in its one array of int64, and the mark of the functions that work on it."""

from collections.abc import Callable
from typing import Any, Final, TypeAlias, TypeVar

Cells: TypeAlias = "memoryview[int]"
"""The state: a memoryview of int64 in plain Python, an int64 array in numba."""
Function = TypeVar("Function", bound=Callable[..., Any])

integer_functions: list[Callable[..., Any]] = []
"""Functions that numba can compile, in the order of their definition."""


def integer(function: Function) -> Function:
    """Mark a function that numba can compile."""
    integer_functions.append(function)
    return function


_used: list[int] = [0]


def _cells(count: int = 1) -> int:
    first = _used[0]
    _used[0] += count
    return first


INSTANTS: Final[list[tuple[int, int]]] = []
"""First cells and numbers of the cells that hold instants: another instant of the same state moves all of them."""


def _instants(count: int = 1) -> int:
    INSTANTS.append((_used[0], count))
    return _cells(count)


GRAINS: Final = 40_040
"""Grains of time in a count of 72 MHz: for a crystal of 8 MHz a cycle has whole grains, whatever the PLL's factor."""
NEVER: Final = 1 << 62

# --- libunicorn: its engine, and the addresses of its functions
UC: Final = _cells()
SELF: Final = _cells()
"""Address of the state itself."""
SOURCES: Final = _cells()
"""A number that is made of the sources of these modules."""
READ_REGISTER: Final = _cells()
WRITE_REGISTER: Final = _cells()
READ_MEMORY: Final = _cells()
WRITE_MEMORY: Final = _cells()
START: Final = _cells()
STOP: Final = _cells()
ACT: Final = _cells()
"""Addresses of functions that numba has compiled once, as the following ones."""
SERVE_EVENTS: Final = _cells()
BUS_READ: Final = _cells()
BUS_WRITE: Final = _cells()
PEND: Final = _cells()
REFRESH: Final = _cells()
ANSWERS: Final = _cells()
"""Address of what answers for the devices outside."""

# --- time, in grains
NOW: Final = _instants()
"""End of the last block that has been executed whole."""
AT: Final = _instants()
"""Present instant of a device's event or of an access to a register."""
CYCLE: Final = _cells()
"""Length of a cycle of the processor (HCLK)."""
CRYSTAL_HZ: Final = _cells()
UNTIL: Final = _cells()
"""End of the stretch that `run` was asked for."""
DUE: Final = _instants()
"""The next event of a device: the least of `DUES`."""
DEVICES: Final = 21
DUES: Final = _instants(DEVICES)
SYSTICK_DUE, TIMER_DUE, SENT_DUE, RECEIVED_DUE, WATCHDOG_DUE = 0, 1, 5, 8, 11
"""Places in `DUES`: one of SysTick, four of the timers, three of the senders and receivers each, one of IWDG."""
CAN_DUE, DMA_DUE, ADC_DUE, WWDG_DUE, RTC_DUE, SPI_DUE, I2C_DUE = 12, 13, 14, 15, 16, 17, 19
"""Further ones: one of each, of SPI and I2C two."""

# --- the block that is being executed
BLOCK: Final = _cells()
BLOCK_SIZE: Final = _cells()
"""Its length in bytes; 0 while no block is open."""
BLOCK_CYCLES: Final = _cells()
WAIT_STATES: Final = _cells()
FLASH_END: Final = _cells()
RAM_END: Final = _cells()

# --- the processor
PC: Final = _cells()
SLEEPING: Final = _cells()
"""1 after WFI, 2 after WFE."""
EVENT: Final = _cells()
"""The event that WFE waits for is registered."""
EXCEPTION: Final = _cells()
"""The number by which unicorn has reported an exception of its own; -1 for none."""
ACCESS: Final = _cells()
"""Address of the access to a peripheral that is being made."""
STOPPED: Final = _cells()
"""1 if a hook has stopped unicorn."""
VECTORS: Final = _cells()
MAIN: Final = _cells()
"""Address of `main`; it becomes 0 when it is reached."""
FAULT: Final = _cells()
"""Why the processor cannot go on, one of `Fault`; 0 while it can."""
FAULT_AT: Final = _cells()
FAULT_PC: Final = _cells()

STACK_LIMIT: Final = _cells()
"""Lowest address for the main stack: below it are variables, or no RAM."""
MASK_CHANGES: Final = _cells()
"""1 if the block that is being executed may change PRIMASK or FAULTMASK."""
MASKED_AT: Final = _instants()
"""Since when one of them keeps all interrupts out, without the time asleep; `NEVER` while none does."""
MASKED_BY: Final = _cells()
"""The block that has set it."""
LONGEST_MASKED: Final = _cells()
"""Longest such time in grains, and the block that began it."""
LONGEST_MASKED_BY: Final = _cells()
SLEPT: Final = _cells()
"""Time asleep in grains."""

# --- a debugger
STEPS_LEFT: Final = _cells()
"""Instructions that a debugger lets pass without a stop."""
STEPPING: Final = _cells()
"""1 to stop before the instruction behind them."""
HALTED: Final = _cells()
"""1 if the processor has stopped for a debugger."""
BREAKPOINTS: Final = 64
BREAKPOINT_COUNT: Final = _cells()
BREAKPOINT: Final = _cells(BREAKPOINTS)
"""Addresses of the breakpoints."""

FRAME: Final = _cells(4)
"""Eight words on their way to the stack or from it, two in each."""

# --- NVIC
EXCEPTIONS: Final = 76
PENDING_SYSTEM: Final = _cells()
"""Exceptions below 16 that are pending, as bits by number."""
PENDING: Final = _cells()
"""Interrupts that are pending, as bits by number."""
ENABLED: Final = _cells()
LINES: Final = _cells()
"""Interrupts whose devices ask for them now."""
ACTIVE_IRQ: Final = _cells()
PRIORITY: Final = _cells(EXCEPTIONS)
GROUP_MASK: Final = _cells()
"""Bits of a priority that decide on preemption."""
BEST: Final = _cells()
"""Priority * 256 + number of the pending exception that comes first; `NEVER` for none."""
DEPTH: Final = _cells()
ACTIVE: Final = _cells(EXCEPTIONS)
ACTIVE_PRIORITY: Final = _cells(EXCEPTIONS)
TAKEN: Final = _cells(EXCEPTIONS)
"""By number, how often an exception was taken."""
LATEST: Final = _cells(EXCEPTIONS)
"""By number, longest time in grains from pending to its handler."""
PENDED_AT: Final = _instants(EXCEPTIONS)
OVERRUNS: Final = _cells(EXCEPTIONS)
"""By number, how often a device had a new event before its last one was served."""

# --- system
SYSTICK_CONTROL: Final = _cells()
SYSTICK_LOAD: Final = _cells()
SYSTICK_LEFT: Final = _cells()
"""Ticks left until SysTick is 0, when it was looked at last; 0: it takes its reload first."""
CYCLES_BASE: Final = _cells()
"""Cycles of DWT at `CYCLES_BASE_AT`."""
CYCLES_BASE_AT: Final = _instants()
CYCLES_ON: Final = _cells()
SYSTEM_WORDS: Final = 0x1000 // 4
SYSTEM: Final = _cells(SYSTEM_WORDS)
"""Words of the system control space that are only memory, from 0xE000E000 on."""

# --- registers of the peripherals, by word from 0x40000000 on
REGISTER_WORDS: Final = 0x24000 // 4
VALUE: Final = _cells(REGISTER_WORDS)
WRITABLE: Final = _cells(REGISTER_WORDS)
MODELLED: Final = _cells(REGISTER_WORDS)
"""Bits whose effect is modelled; others may be written as 0 only."""
DEVICE: Final = _cells(REGISTER_WORDS)
"""16 * kind + number of the device, of `registers`; 0: not modelled."""
CLOCK: Final = _cells(REGISTER_WORDS)
"""32 * word + bit of the register that switches a device's clock on; -1: it always is."""

# --- pins, by port A to E
PORTS: Final = 5
PUSH_PULL: Final = _cells(PORTS)
OPEN_DRAIN: Final = _cells(PORTS)
ALTERNATE: Final = _cells(PORTS)
"""Outputs whose level a peripheral sets."""
PULLED: Final = _cells(PORTS)
"""Inputs with a pull-up or pull-down."""
BY_DEVICE: Final = _cells(PORTS)
"""Levels that peripherals set at their pins."""
OUTSIDE: Final = _cells(PORTS)
"""Levels that the machine sets at its pins."""
DRIVEN: Final = _cells(PORTS)
"""Pins whose level the machine sets."""
RELEASED: Final = _cells(PORTS)
"""Levels of the wires when the chip's pin is no output."""
LEVELS: Final = _cells(PORTS)
WATCHED: Final = _cells(PORTS)
"""Pins whose edges are kept."""
WAS_OUTPUT: Final = _cells(PORTS)
"""Pins that have been outputs since power-up."""
LEFT_OUTPUT: Final = _cells(PORTS)
"""Those of them that have become inputs again."""
EDGE_CAPACITY: Final = 8192
EDGE_COUNT: Final = _cells()
EDGES: Final = _cells(2 * EDGE_CAPACITY)
"""Edges: instant in counts, and 2 * (16 * port + pin) + level."""

# --- timers 1 to 4
TIMERS: Final = 4
COUNTER: Final = _cells(TIMERS)
"""Counter at `COUNTER_AT`; it grows by 1 each `COUNTER_TICK` grains, of a timer that runs."""
COUNTER_AT: Final = _instants(TIMERS)
COUNTER_TICK: Final = _cells(TIMERS)
PRESCALER: Final = _cells(TIMERS)
RELOAD: Final = _cells(TIMERS)
COMPARE: Final = _cells(4 * TIMERS)
OUTPUT: Final = _cells(4 * TIMERS)
"""Level of each channel's output, before its polarity."""
CHANNEL_PIN: Final = _cells(4 * TIMERS)
"""16 * port + pin of each channel."""

TIMER_AWAITED: Final = _cells(TIMERS)
"""Events of each timer that another timer or the ADC waits for: update is bit 0, the compares are bits 1 to 4."""
TIMER_HELD: Final = _cells(TIMERS)
"""1 for a timer that counts edges of a trigger or encoder, 2 for one that a gate holds."""
TIMER_EDGES: Final = _cells(TIMERS)
"""Edges since the last count, before the prescaler."""
TIMER_FALLS: Final = _cells(TIMERS)
"""1 if an encoder has turned down."""
TIMER_PULSES: Final = _cells()
"""Triggers that timers have given, as bits, their ends from bit 16 on, and bit 8 for edges at inputs."""
CAPTURE_EDGES: Final = _cells(4 * TIMERS)
"""Edges since the last capture."""
INPUT_MASK: Final = _cells(PORTS)
"""Pins whose edges timers need."""
INPUT_RISES: Final = _cells(PORTS)
INPUT_FALLS: Final = _cells(PORTS)

# --- USART 1 to 3
USARTS: Final = 3
TEXT_CAPACITY: Final = 1 << 16
SENT_COUNT: Final = _cells(USARTS)
SENT: Final = _cells(USARTS * TEXT_CAPACITY)
SHIFTING: Final = _cells(USARTS)
"""The byte that is being sent; -1 for none."""
WAITING: Final = _cells(USARTS)
"""The byte in the data register that is to be sent next; -1 for none."""
ARRIVED_COUNT: Final = _cells(USARTS)
"""Bytes that have arrived, of `GIVEN_COUNT`."""
GIVEN_COUNT: Final = _cells(USARTS)
GIVEN: Final = _cells(USARTS * TEXT_CAPACITY)

# --- watchdogs
WATCHDOG_ON: Final = _cells()
WWDG_START: Final = _cells()
"""Counter of WWDG at `WWDG_START_AT`."""
WWDG_START_AT: Final = _instants()

# --- ADC1
ADC_CHANNELS: Final = 18
ADC_INPUT: Final = _cells(ADC_CHANNELS)
"""What a conversion of each channel yields."""
ADC_PLACE: Final = _cells()
"""Place in the sequence that is being converted."""
ADC_AWAITED: Final = _cells()
"""5 * timer + event that starts a sequence; -1 for none."""

# --- SPI 1 and 2, I2C 1 and 2
SERIALS: Final = 2
SPI_SHIFTING: Final = _cells(SERIALS)
"""The word that is being exchanged; -1 for none. Likewise for the following ones."""
SPI_WAITING: Final = _cells(SERIALS)
SPI_READ: Final = _cells(SERIALS)
"""1 if DR has been read since SR was."""
I2C_STATE: Final = _cells(SERIALS)
I2C_SHIFTING: Final = _cells(SERIALS)
I2C_WAITING: Final = _cells(SERIALS)
I2C_ACK: Final = _cells(SERIALS)
"""ACK when the byte began that is being received."""
I2C_MORE: Final = _cells(SERIALS)
"""1 if the last byte was acknowledged, so that another one follows."""
SELECT_MASK: Final = _cells(PORTS)
"""Pins that select a device."""

# --- the flash's controller
FLASH_KEYS: Final = _cells()
"""Right keys that have been written; -1 after a wrong one."""
FLASH_WRITES: Final = _cells()
"""Half-words that have been programmed."""
FLASH_ERASES: Final = _cells()

# --- CAN
CAN_CHANGED: Final = _cells()
"""1 if the firmware has done what the bus must know: a mode, a bit timing, or a mailbox."""
CAN_SENDING: Final = _cells()
"""The mailbox whose frame is on the wire; -1 for none."""
CAN_REQUESTS: Final = _cells()
"""Number of transmit requests so far."""
CAN_REQUESTED: Final = _cells(3)
"""By mailbox, the number of its last transmit request."""
CAN_FIFO: Final = _cells(2 * 3 * 4)
"""By FIFO and place the registers RIxR, RDTxR, RDLxR and RDHxR of a frame; place 0 is read."""

# --- DMA1
DMA_CHANNELS: Final = 7
DMA_PULSES: Final = _cells()
"""Requests that stand until they are served, as bits by channel, from 0."""
DMA_LEVELS: Final = _cells()
"""Requests that stand as long as a flag does: 8 bits for each kind of peripherals, by channel."""
DMA_TOTAL: Final = _cells(DMA_CHANNELS)
"""Transfers of a round: CNDTR when the channel was enabled."""

# --- accesses that are not modelled
STRANGE_CAPACITY: Final = 256
STRANGE_COUNT: Final = _cells()
STRANGE_FIELDS: Final = 4
STRANGE: Final = _cells(STRANGE_FIELDS * STRANGE_CAPACITY)
"""Address, kind of `Strange`, number of times, PC of the first."""
STRANGE_LOST: Final = _cells()

# --- cost of the blocks in flash, by halfword
BLOCK_COSTS: Final = 512 * 1024 // 2
KNOWN_SIZE: Final = _cells(BLOCK_COSTS)
KNOWN_CYCLES: Final = _cells(BLOCK_COSTS)
"""Twice the cycles, and 1 if the block may change PRIMASK or FAULTMASK."""
PART_BEGIN: Final = _cells(BLOCK_COSTS)
"""By the halfword of an instruction, the block for which its `PART_CYCLES` are right."""
PART_CYCLES: Final = _cells(BLOCK_COSTS)
SPENT: Final = _cells(BLOCK_COSTS)
"""Time in grains that each block in flash has taken; that of code elsewhere is in the last one."""

CELLS: Final = _used[0]

# --- numbers that several modules use
FLASH_START: Final = 0x08000000
PERIPHERALS: Final = 0x40000000
FAULT_UNMAPPED, FAULT_UNDEFINED, FAULT_BREAKPOINT, FAULT_VECTOR, FAULT_ESCALATED, FAULT_WATCHDOG = 1, 2, 3, 4, 5, 6
FAULT_UNICORN, FAULT_RESET, FAULT_RETURN, FAULT_STACK = 7, 8, 9, 10
STRANGE_READ, STRANGE_WRITE, STRANGE_NO_CLOCK, STRANGE_BITS = 0, 1, 2, 3
