"""`steptwin personality [NAME]`: the objects of a drive that a board can show, or their EDS."""

from steptwin.features.personalities.cells import PersonalityRow
from steptwin.features.personalities.file import Behind, personality_names
from steptwin.features.personalities.personality import Personality, load_personality
from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import AnswerOptions
from steptwin.host.cli.options import argument, switch
from steptwin.host.cli.output import print_table, print_text
from steptwin.protocol import od


@command("epos4", "epos4 --eds > epos4.eds")
def personality(
    answer: AnswerOptions,
    name: str | None = argument("NAME|FILE", "Name of a personality, or its file; without one, all are named."),
    eds: bool = switch("Print the EDS (CiA 306)."),
) -> None:
    """List the objects of another manufacturer's drive that a board can show, or print their EDS.

    `steptwin serve --machine personality=NAME` shows them on the bus (docs/personalities.md).
    """
    if name is None:
        devices = {each: load_personality(each).device for each in personality_names()}
        rows = [[each, device] for each, device in devices.items()]
        answer.tell({"personalities": devices}, lambda: print_table(["name", "drive"], rows, text_columns=2))
        return
    made = load_personality(name)
    if eds:
        from steptwin.protocol.exports import render_eds

        print_text(render_eds(made.eds()))
        return
    objects = listed(made)
    answer.tell(
        {"device": made.device, "objects": objects, "lacking": dict(made.lacking)},
        lambda: print_table(list(objects[0]), [list(row.values()) for row in objects], text_columns=len(objects[0])),
        "not there:",
        *(f"  {what}: {why}" for what, why in made.lacking.items()),
    )


def listed(made: Personality) -> list[dict[str, str]]:
    """Return a table of a personality's entries, without the parameters of PDOs."""
    return [
        {
            "object": od.place_text(address),
            "name": row.entry.name,
            "behind": behind_text(address, row),
            "default": f"{row.entry.default}",
            "source": row.source,
        }
        for address, row in sorted(made.rows.items())
        if not is_pdo_parameter(address)
    ]


def is_pdo_parameter(address: int) -> bool:
    """Return whether an entry is a parameter of a PDO."""
    return 0x1400 <= address >> 8 < 0x1C00


def behind_text(address: int, row: PersonalityRow) -> str:
    """Return what stands behind an entry: `firmware`, with its object if that has another address, or the like."""
    if row.behind is Behind.FIRMWARE and row.firmware not in (None, address):
        return f"firmware {od.place_text(row.firmware or 0)}"
    return row.behind.value
