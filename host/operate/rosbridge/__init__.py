"""A served board in ROS, through a rosbridge server: joint_states, and FollowJointTrajectory."""

from steptwin.host.operate.rosbridge.bridge import RosChannel, RosBridge, RosbridgeLostError
from steptwin.host.operate.rosbridge.goal_states import GoalState
from steptwin.host.operate.rosbridge.messages import RosNames

__all__ = ["RosChannel", "GoalState", "RosBridge", "RosNames", "RosbridgeLostError"]
