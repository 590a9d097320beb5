"""Programs: motions that users write as steps in a TOML file, such as `go`, `line` and `output`."""

from steptwin.host.planning.programs.compiling import CompiledProgram, StepRow, compile_program
from steptwin.host.planning.programs.names import check_names
from steptwin.host.planning.programs.program import Program, load_own_robot
from steptwin.host.planning.programs.program_file import SUFFIX, parse_program, read_program

__all__ = [
    "SUFFIX",
    "CompiledProgram",
    "Program",
    "StepRow",
    "check_names",
    "compile_program",
    "load_own_robot",
    "parse_program",
    "read_program",
]
