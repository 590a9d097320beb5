"""`steptwin kernel-c DIR`: write the firmware's motion kernel as C."""

from pathlib import Path
from typing import Annotated

import typer

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import Replace, keep_files
from steptwin.host.cli.output import say


@command("firmware/kernel", ".")
def kernel_c(
    folder: Annotated[str, typer.Argument(metavar="DIR", help="Folder to write the files into; made if missing.")],
    replace: Replace = False,
) -> None:
    """Write the firmware's motion kernel as C11: header, source, an example and a README with units and limits."""
    from steptwin.host.common.whole_file import whole_file
    from steptwin.host.twin.machine.kernels import kernel_files

    target, files = Path(folder), kernel_files()
    keep_files((target / name for name in files), replace=replace)
    target.mkdir(parents=True, exist_ok=True)
    for name, text in files.items():
        with whole_file(target / name) as file:
            file.write(text.encode())
    say(f"the kernel is in {target}/: begin with README.md")
