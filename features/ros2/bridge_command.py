"""`steptwin ros2-bridge ROBOT --connect ...`: offer a live board to ROS 2 through a rosbridge server."""

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import RobotName
from steptwin.host.cli.live.connection import SessionOptions, host_and_port
from steptwin.host.cli.options import naming_options, option


@command(
    "teaching-scara --connect 127.0.0.1",
    "ar4-mk3 --rosbridge 127.0.0.1:9090 --connect 127.0.0.1",
)
def ros2_bridge(
    live: SessionOptions,
    robot: RobotName = None,
    rosbridge: str = option("HOST[:PORT]", "Server of rosbridge; port 9090 by default.", default="127.0.0.1"),
    controller: str = option(
        "NAME", "Name in ROS of the controller whose action this is.", default="joint_trajectory_controller"
    ),
) -> None:
    """Offer a live machine to ROS 2 through a rosbridge server, until Ctrl-C.

    It publishes /joint_states ten times a second and is the server of NAME/follow_joint_trajectory, one goal at a time.
    A goal that is canceled, and a lost connection, stop all axes.
    """
    from steptwin.features.ros2.bridge import PORT, RosBridge, RosbridgeSocket, require_websockets
    from steptwin.features.ros2.goals import GoalState
    from steptwin.features.ros2.messages import RosNames
    from steptwin.host.client.links import address_text

    loaded = live.robot(robot)
    host, port = host_and_port("--rosbridge", rosbridge, PORT, optional=True)
    address = address_text(host, port)
    with naming_options("controller"):
        names = RosNames.of(controller)
    require_websockets()
    with live.lasting_session(loaded) as session, RosbridgeSocket(host, port) as channel:
        live.add(f"{names.action} and {names.topic}, through rosbridge at {address}", "Ctrl-C ends it")
        bridge = RosBridge(session, channel, names, live.add)
        bridge.run()
    ends = {state.name.lower(): bridge.ends[state] for state in GoalState if state.ended}
    live.tell_of(loaded, {"goals": ends}, ", ".join(f"{count} {name}" for name, count in ends.items()))
