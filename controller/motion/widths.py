"""Names of integer widths: promises that the kernel makes about its values, for a port to C.

To Python, mypy and numba each of them is `int`. The translator (`emulator/kernel_c`) reads them from the source. It
takes a promise as given and proves by interval arithmetic that everything between fits 64 bits. The tests run the
kernel with each promise checked (`emulator/kernel_c/promises.py`).

U<n> has n bits without sign, I<n> n bits with sign (two's complement), and Q<n> means from -2^n to 2^n, both included.
"""

from typing import TypeAlias

U1: TypeAlias = int
U2: TypeAlias = int
U3: TypeAlias = int
U4: TypeAlias = int
U5: TypeAlias = int
U6: TypeAlias = int
U7: TypeAlias = int
U8: TypeAlias = int
U10: TypeAlias = int
U12: TypeAlias = int
U17: TypeAlias = int
U30: TypeAlias = int
U31: TypeAlias = int
U44: TypeAlias = int
U47: TypeAlias = int
U48: TypeAlias = int
I32: TypeAlias = int
I34: TypeAlias = int
I40: TypeAlias = int
I42: TypeAlias = int
I44: TypeAlias = int
I49: TypeAlias = int
I60: TypeAlias = int
I63: TypeAlias = int
I64: TypeAlias = int
Q30: TypeAlias = int
Q32: TypeAlias = int
