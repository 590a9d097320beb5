"""Programs: motions that users write as steps in a TOML file, such as `go`, `line` and `output`."""

from steptwin.host.planning.programs.compiling import CompiledProgram, StepRow, compile_program
from steptwin.host.planning.programs.program import Program
from steptwin.host.planning.programs.reading import SUFFIX, parse_program, read_program

__all__ = [
    "SUFFIX",
    "CompiledProgram",
    "Program",
    "StepRow",
    "compile_program",
    "parse_program",
    "read_program",
]
