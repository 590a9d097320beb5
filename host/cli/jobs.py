"""`steptwin jobs ROBOT`: a robot's named trajectories and their options."""

from host.cli.app import app
from host.cli.arguments import AsJson, RobotFile, RobotName, one_robot
from host.cli.output import print_json, print_table


@app.command()
def jobs(robot: RobotName = None, robot_file: RobotFile = None, as_json: AsJson = False) -> None:
    """List a robot's jobs with their options."""
    from host.jobs import job_names, job_options

    loaded = one_robot(robot, robot_file)
    found = {name: job_options(loaded, name) for name in job_names(loaded)}
    if as_json:
        print_json({"robot": loaded.name, "jobs": [{"name": n, "options": o} for n, o in found.items()]})
    else:
        rows = [[name, option, text] for name, options in found.items() for option, text in options.items()]
        print_table(["job", "option", "default (valid)"], rows, text_columns=3)
