"""What users ask of a robot's navigation, read: goals and initial poses. Whatever is wrong with one is a text."""

from zteam import names
from zteam.geometry import Pose2
from zteam.messages import PoseStamped, PoseWithCovarianceStamped
from zteam.nodes.navigation.inputs import Inputs
from zteam.nodes.navigation.way import Goal
from zteam.services.poses import planar


def read_goal(message: PoseStamped, inputs: Inputs) -> Goal | str:
    """The goal in `map`, or why it is none. Without a frame it is in `map`."""
    frame = names.strip_slash(message.header.frame_id) or names.MAP_FRAME
    pose, place = planar(message.pose), Pose2(0.0, 0.0, 0.0)
    if frame != names.MAP_FRAME:
        found = inputs.find(names.MAP_FRAME, frame)
        if found is None:
            return f"the goal is in the frame {frame!r}, which no transform leads to"
        place = found.pose
    if pose is None:
        return "the goal is not finite, or its orientation is no rotation"
    return Goal(message, place.compose(pose))


def read_initial_pose(message: PoseWithCovarianceStamped) -> Pose2 | str:
    """The pose of the base in `map`, or why it is none."""
    frame = names.strip_slash(message.header.frame_id) or names.MAP_FRAME
    if frame != names.MAP_FRAME:
        return f"its frame is {frame!r}, not {names.MAP_FRAME!r}"
    return planar(message.pose.pose) or "it is not finite, or its orientation is no rotation"
