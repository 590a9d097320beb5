"""A served board in ROS, through a rosbridge server: joint_states, and FollowJointTrajectory."""

from steptwin.host.operate.rosbridge.bridge import RosBridge, RosbridgeLostError, RosChannel
from steptwin.host.operate.rosbridge.goals import GoalState
from steptwin.host.operate.rosbridge.messages import RosNames

__all__ = ["GoalState", "RosBridge", "RosChannel", "RosNames", "RosbridgeLostError"]
