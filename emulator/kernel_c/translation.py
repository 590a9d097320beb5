"""The kernel as a C header and a C source file."""

import ast
from dataclasses import dataclass
from functools import cache
from typing import Final

from steptwin.emulator.kernel_c.functions import Function, comment
from steptwin.emulator.kernel_c.ranges import Range
from steptwin.emulator.kernel_c.source import PUBLIC, RECORD_OF, Record, Source, kernel_source

_PAIR: Final = "static inline {type} {name}({type} x, {type} y)\n{{\n    return x {sign} y ? x : y;\n}}\n"
_ABS: Final = "static inline {type} {name}({type} x)\n{{\n    return x < 0 ? -x : x;\n}}\n"

_DIVIDE: Final = """\
/* Divide 64 bits by 32, rounded down. A Cortex-M3 divides only 32 bits at once, and its library takes hundreds of
   cycles for 64. A divisor below 2^20 leaves 12 bits of room above each remainder, so that three steps
   divide the low word. */
static uint64_t st_divide(uint64_t numerator, uint32_t divisor)
{
    const uint32_t low = (uint32_t)numerator;
    const uint32_t high = (uint32_t)(numerator >> 32);
    const uint32_t quotient = high / divisor;
    uint32_t rest = high - quotient * divisor;
    uint32_t part = 0;
    if (divisor < (UINT32_C(1) << 20)) {
        uint32_t next = (rest << 12) | (low >> 20);
        uint32_t digit = next / divisor;
        part = digit << 20;
        next = ((next - digit * divisor) << 12) | ((low >> 8) & UINT32_C(0xFFF));
        digit = next / divisor;
        part |= digit << 8;
        next = ((next - digit * divisor) << 8) | (low & UINT32_C(0xFF));
        part |= next / divisor;
    } else {
        for (uint32_t bit = UINT32_C(1) << 31; bit != 0; bit >>= 1) {
            const uint32_t carry = rest >> 31;
            rest = (rest << 1) | ((low & bit) != 0 ? 1U : 0U);
            if (carry != 0 || rest >= divisor) {
                rest -= divisor;
                part |= bit;
            }
        }
    }
    return ((uint64_t)quotient << 32) | part;
}
"""

_FLOOR_DIVIDE: Final = """\
/* Divide by a positive number, rounded down also where the quotient is negative, as Python's // does. */
static int64_t st_floor_divide(int64_t numerator, uint32_t divisor)
{
    if (numerator >= 0) {
        return (int64_t)st_divide((uint64_t)numerator, divisor);
    }
    return -(int64_t)st_divide((uint64_t)-numerator + (divisor - 1U), divisor);
}
"""

HELPERS: Final = {
    "st_divide": _DIVIDE,
    "st_floor_divide": _FLOOR_DIVIDE,
    **{
        f"st_{name}_{bits}": _PAIR.format(type=f"int{bits}_t", name=f"st_{name}_{bits}", sign=sign)
        for name, sign in (("min", "<"), ("max", ">"))
        for bits in (32, 64)
    },
    **{f"st_abs_{bits}": _ABS.format(type=f"int{bits}_t", name=f"st_abs_{bits}") for bits in (32, 64)},
}
"""C text by name, each after those that it calls."""
CALLS: Final = {"st_floor_divide": "st_divide"}


HEADER: Final = "steptwin_kernel.h"
BODY: Final = "steptwin_kernel.c"

_LIMITS: Final = """\
Storage: `axes` is one st_axis for each axis, `queue` ST_QUEUE_DEPTH st_segment for each axis, `clk` and `direction`
one row of edges for each axis, as long as the edges of a call. All begins as 0, except that last_rise_counts is
ST_NEVER_COUNTS, microsteps and duration_ticks are 1 and the group's rate_to_q16 is ST_FULL_RATE_Q16.
An edge is the low 32 bits of what the text says: at 72 MHz a CLK edge repeats after 59 s, a DIR edge after 29 s."""


@dataclass(frozen=True, slots=True)
class CSource:
    """The texts of both files."""

    header: str
    body: str


@cache
def translate() -> CSource:
    """Translate the kernel that is imported; raise TranslationError if it leaves the subset."""
    source = kernel_source()
    helpers: set[str] = set()
    functions = {name: Function(source, node, helpers) for name, node in source.functions.items()}
    bodies = {name: function.body() for name, function in functions.items()}
    public = [functions[name] for name in source.functions if name in PUBLIC]
    return CSource(_header(source, public), _body(functions, bodies, helpers))


def _header(source: Source, public: list[Function]) -> str:
    lines = [
        *comment((ast.get_docstring(source.tree) or "") + "\n\n" + _LIMITS),
        "#ifndef STEPTWIN_KERNEL_H",
        "#define STEPTWIN_KERNEL_H",
        "",
        "#include <stdbool.h>",
        "#include <stdint.h>",
        "",
        *_constants(source),
    ]
    for record in (source.records[name] for name in dict.fromkeys(RECORD_OF.values())):
        lines += ["", *_structure(record)]
    for function in public:
        lines += ["", *function.result_structure] if function.result_structure else []
    for function in public:
        lines += ["", *function.documentation, f"{function.signature};"]
    return "\n".join([*lines, "", "#endif", ""])


def _constants(source: Source) -> list[str]:
    lines = []
    body = source.tree.body
    for i, node in enumerate(body):
        if not isinstance(node, ast.AnnAssign) or not isinstance(node.target, ast.Name):
            continue
        name = node.target.id
        if name not in source.constants:
            continue
        text = [source.comments[at][1] for at in _block_above(source, node.lineno)]
        lines += ["", *comment("\n".join(text))] if text else []
        value = source.constants[name]
        digits = f"INT64_C({abs(value)})" if Range(value, value).bits == 64 else str(abs(value))
        lines.append(f"#define ST_{name} {digits if value >= 0 else f'(-{digits})'}")
        following = body[i + 1] if i + 1 < len(body) else None
        if isinstance(following, ast.Expr) and isinstance(following.value, ast.Constant):
            lines += comment(str(following.value.value))
    return lines


def _block_above(source: Source, line: int) -> list[int]:
    first = line
    while first - 1 in source.comments:
        first -= 1
    return list(range(first, line))


def _structure(record: Record) -> list[str]:
    declared = [(f"    {member.storage} {member.name};", member.range) for member in record.members]
    members = [f"{text:<42}/* {_span(known)} */" for text, known in declared]
    return ["typedef struct {", *members, f"}} st_{record.name};"]


def _span(known: Range) -> str:
    if known.low == 0 and known.high < 1 << 17:
        return f"0 .. {known.high}"
    bits = known.high.bit_length()
    return f"0 .. 2^{bits} - 1" if known.low == 0 else f"-2^{bits} .. 2^{bits} - 1"


def _body(functions: dict[str, Function], bodies: dict[str, list[str]], helpers: set[str]) -> str:
    needed = helpers | {CALLS[name] for name in helpers if name in CALLS}
    lines = [
        "/* The motion kernel; its text is translated from StepTwin's controller/motion/kernel.py. See the header. */",
        f'#include "{HEADER}"',
        "",
        "#include <stddef.h>",
        "",
        "/* As in <string.h>, which a core without a C library does not have. */",
        "void *memcpy(void *restrict target, const void *restrict source, size_t size);",
        "",
        '_Static_assert((-1 >> 1) == -1 && (INT64_C(-1) >> 1) == -1, "shifts of negative numbers must keep the sign");',
    ]
    for record in kernel_source().records.values():
        lines.append(f'_Static_assert(sizeof(st_{record.name}) == {record.size}, "layout of st_{record.name}");')
    for name, text in HELPERS.items():
        lines += ["", text.rstrip()] if name in needed else []
    lines += ["", *(f"{functions[name].signature};" for name in functions if name not in PUBLIC)]
    for name, function in functions.items():
        lines += [
            "",
            *(function.documentation if name not in PUBLIC else []),
            function.signature,
            "{",
            *bodies[name],
            "}",
        ]
    return "\n".join([*lines, ""])
