"""Why a user's module cannot be imported, on one line: the user's own file and line, and the way out."""

import sys
from pathlib import Path

from zteam.errors import did_you_mean

_ZTEAM = str(Path(__file__).parents[1])
_OF_ROS = {
    **dict.fromkeys(("rospy", "rclpy"), "a behaviour has step(view), a node of your own runs by zteam.run"),
    **dict.fromkeys(("tf", "tf2_ros", "tf_transformations"), "zteam.TransformListener and zteam.Pose2 do its work"),
    **dict.fromkeys(
        ("geometry_msgs", "sensor_msgs", "nav_msgs", "std_msgs", "tf2_msgs", "visualization_msgs"),
        "its message types are in zteam.messages",
    ),
}
"""What stands for a module of ROS."""


def explain(error: BaseException) -> str:
    """`file:line: Type: text (way out)` of an error that importing a user's module raised."""
    return f"{_place(error)}{error_text(error)}{_way_out(error)}"


def error_text(error: BaseException) -> str:
    """The type of an error and what it says, on one line."""
    return f"{type(error).__name__}: {' '.join(str(error).split())}".removesuffix(": ")


def _place(error: BaseException) -> str:
    """`file:line: ` of the user's own line that ended the import; empty if none was run."""
    if isinstance(error, SyntaxError):
        # Its text names the line.
        return ""
    import traceback

    own = [frame for frame in traceback.extract_tb(error.__traceback__) if is_own(frame.filename)]
    return f"{own[-1].filename}:{own[-1].lineno}: " if own else ""


def is_own(filename: str) -> bool:
    """Whether a file of code is the user's own, and neither zteam's, Python's nor an installed package's."""
    return not filename.startswith(("<frozen ", _ZTEAM, sys.prefix, sys.base_prefix))


def _way_out(error: BaseException) -> str:
    if not isinstance(error, ImportError):
        return ""
    of_ros = _OF_ROS.get((error.name or "").partition(".")[0])
    if of_ros:
        return f" (zteam works without ROS: {of_ros})"
    if isinstance(error, ModuleNotFoundError):
        return " (is it beside the team file, in the current folder or on PYTHONPATH?)"
    quoted = str(error).split("'")
    return _name_of_zteam(quoted[1]) if error.name == "zteam" and len(quoted) > 1 else ""


def _name_of_zteam(name: str) -> str:
    """What a name that `zteam` lacks may stand for."""
    from zteam import messages

    if name in dir(messages):
        return f" (from zteam.messages import {name})"
    return did_you_mean(name, dir(sys.modules["zteam"]))
