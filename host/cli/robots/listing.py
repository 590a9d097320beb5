"""`steptwin robots` and `steptwin jobs ROBOT`: list the robots that come with StepTwin, and the jobs of one."""

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import AsJson, RobotFile, RobotName, one_robot
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


@command("warehouse-scara", "--robot-file mine.toml")
def jobs(robot: RobotName = None, robot_file: RobotFile = None, as_json: AsJson = False) -> None:
    """List a robot's jobs with their options."""
    from steptwin.host.planning.jobs import job_names, job_options, job_summary

    loaded = one_robot(robot, robot_file)
    found = {name: job_options(loaded, name) for name in job_names(loaded)}
    summaries = {name: job_summary(loaded, name) for name in found}
    if as_json:
        listed = [{"name": n, "summary": summaries[n], "options": options} for n, options in found.items()]
        print_json({"robot": loaded.name, "paper": loaded.paper or None, "jobs": listed})
        return
    if loaded.paper:
        say(f"paper: {loaded.paper}")
    for name, summary in summaries.items():
        say(f"{name}: {summary}")
    if not found:
        say(f"{loaded.name} has no jobs: a robot of the kind {loaded.kinematics} runs programs and trajectory files")
        return
    rows = [[name, option, text] for name, options in found.items() for option, text in options.items()]
    print_table(["job", "option", "default (valid)"], rows, text_columns=3)
