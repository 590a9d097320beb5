"""`steptwin robots`: list the robots that come with StepTwin."""

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import AsJson
from steptwin.host.cli.output import print_json, print_table, say


@command("", "--json")
def robots(as_json: AsJson = False) -> None:
    """List the robots that come with StepTwin."""
    from steptwin.host.robots import load_robot, robot_names

    found = [load_robot(name) for name in robot_names()]
    if as_json:
        rows = [{"name": r.name, "title": r.title, "joints": list(r.joint_names), "paper": r.paper} for r in found]
        print_json({"robots": rows})
    else:
        table = [[r.name, r.title, " ".join(r.joint_names)] for r in found]
        print_table(["robot", "what it is", "joints"], table, text_columns=3)
        say("", "their papers:", *(f"{r.name}: {r.paper}" for r in found))
