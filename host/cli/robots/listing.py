"""`steptwin robots` and `steptwin jobs ROBOT`: list the robots that come with StepTwin, and the jobs of one."""

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import AnswerOptions, RobotName, RobotOptions
from steptwin.host.cli.output import print_table, say


@command("", "--json")
def robots(answer: AnswerOptions) -> None:
    """List the robots that come with StepTwin."""
    from steptwin.host.robots import load_robot, robot_names

    found = [load_robot(name) for name in robot_names()]
    listed = [{"name": r.name, "title": r.title, "joints": list(r.joint_names), "paper": r.paper} for r in found]

    papers = [f"{robot.name}: {robot.paper}" for robot in found if robot.paper]

    def table() -> None:
        print_table(
            ["robot", "what it is", "joints"],
            [[r.name, r.title, " ".join(r.joint_names)] for r in found],
            text_columns=3,
        )

    answer.tell(
        {"robots": listed},
        table,
        *(["", "their papers:", *papers] if papers else []),
    )


@command("my-arm.toml", "--robot-file mine.toml")
def jobs(which: RobotOptions, robot: RobotName = None) -> None:
    """List a robot's jobs with their options."""
    from steptwin.host.planning.jobs import job_names, job_options, job_summary

    loaded = which.robot(robot)
    found = {name: job_options(loaded, name) for name in job_names(loaded)}
    summaries = {name: job_summary(loaded, name) for name in found}

    def in_words() -> None:
        if loaded.paper:
            say(f"paper: {loaded.paper}")
        say(*(f"{name}: {summary}" for name, summary in summaries.items()))
        if not found:
            kind = f"a robot of the kind {loaded.kinematics}"
            say(f"{loaded.name} has no jobs: {kind} runs programs and trajectory files")
            return
        rows = [[name, option, text] for name, options in found.items() for option, text in options.items()]
        print_table(["job", "option", "default (valid)"], rows, text_columns=3)

    listed = [{"name": name, "summary": summaries[name], "options": options} for name, options in found.items()]
    which.tell_of(loaded, {"paper": loaded.paper or None, "jobs": listed}, in_words)
