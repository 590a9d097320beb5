"""`steptwin sensitivity ROBOT Q1 Q2 ...`: how each DH parameter moves the tool."""

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import AsJson, RobotAndJoints, RobotFile, robot_and_joints
from steptwin.host.cli.output import fixed, print_json, print_table, say


@command("calibration-scara 30 45 50 20", "lab-scara 150 0 90 0 --json", negatives=True)
def sensitivity(
    words: RobotAndJoints = None,
    robot_file: RobotFile = None,
    as_json: AsJson = False,
) -> None:
    """Compute how far an error of each DH parameter takes the tool: the error transfer coefficients at a position.

    A row has the derivatives of the tool's position and of its turns about the world's axes, per mm of a length and per
    degree of an angle. A turn rz adds to the attitude. For robots that are chains of DH links, with the errors that
    their files state.
    """
    import numpy as np

    from steptwin.host.robots.kinematics.chain import MOVES, Chain
    from steptwin.host.robots.link_errors import unit_of

    loaded, values = robot_and_joints(words or [], robot_file)
    chain = Chain.of(loaded)
    moves = chain.sensitivities(np.array([values]))[0].T.tolist()
    if as_json:
        rows = {name: dict(zip(MOVES, row, strict=True)) for name, row in zip(chain.parameters, moves, strict=True)}
        print_json({"robot": loaded.name, "joints": dict(zip(loaded.joint_names, values, strict=True)), "per": rows})
        return
    columns = ["parameter", "per", *(move.replace("_", " ") for move in MOVES)]
    cells = [[name, unit_of(name), *map(fixed, row)] for name, row in zip(chain.parameters, moves, strict=True)]
    print_table(columns, cells, text_columns=2)
    say(
        f"{chain.table.convention.value} DH parameters; link1 is at the world, {chain.table.link_names[-1]} at the tool"
    )
