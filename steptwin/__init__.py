"""StepTwin: a firmware-faithful twin of STM32 + TB6560 stepper boards.

These are the names that most programs need; docs/api.md describes each. A name is imported when it is first used, so
`import steptwin` takes only milliseconds. The stub beside this file, `__init__.pyi`, says where each name is from.
"""

import os
from importlib import import_module

__version__ = "1.0.0"

if not os.path.isdir(f"{__path__[0]}/host"):  # a checkout without symbolic links, as git makes it on Windows
    __path__.append(os.path.dirname(__path__[0]))

_STUB = __loader__.get_data(f"{__path__[0]}/__init__.pyi").decode()
_MODULE_OF = {words[5]: words[1] for line in _STUB.splitlines() if len(words := line.split()) == 6}
"""The module of each public name, by lines such as `from steptwin.protocol.frame import Frame as Frame`."""
__all__ = sorted(_MODULE_OF)  # noqa: PLE0605


def __getattr__(name: str) -> object:
    """Import a public name when it is first used (PEP 562)."""
    if name not in _MODULE_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = globals()[name] = getattr(import_module(_MODULE_OF[name]), name)
    return value


def __dir__() -> list[str]:
    """List the public names, whether imported yet or not."""
    return [*__all__, "__version__"]
