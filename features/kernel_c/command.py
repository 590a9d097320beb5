"""`steptwin kernel-c DIR`: write the firmware's motion kernel as C."""

from dataclasses import MISSING
from pathlib import Path

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import Replace, keep_files
from steptwin.host.cli.options import argument
from steptwin.host.cli.output import say


@command("firmware/kernel", ".")
def kernel_c(
    folder: str = argument("DIR", "Folder to write the files into; made if missing.", MISSING),
    replace: Replace = False,
) -> None:
    """Write the firmware's motion kernel as C11: header, source, an example and a README with units and limits."""
    from steptwin.features.kernel_c.layout import kernel_files
    from steptwin.host.common.whole_file import write_whole

    target, files = Path(folder), kernel_files()
    keep_files((target / name for name in files), replace=replace)
    target.mkdir(parents=True, exist_ok=True)
    for name, text in files.items():
        write_whole(target / name, text)
    say(f"the kernel is in {target}/: begin with README.md")
