"""What ROS and other programs call the commands."""

MEANT = {
    "up": "run start launch roslaunch team",
    "topic": "rostopic topics",
    "topic echo": "print cat show",
    "topic pub": "publish send",
    "recording": "rosbag bag mcap",
    "tf echo": "tf_echo tf2_echo",
    "tf tree": "view_frames rqt_tf_tree frames",
    "tf monitor": "tf_monitor tf2_monitor",
    "tf static": "static_transform_publisher",
    "node": "rosnode",
    "param": "rosparam params dynparam",
    "sim pause": "pause halt",
    "sim resume": "resume unpause play start continue",
    "sim spawn": "spawn add create",
    "sim remove": "remove delete kill",
    "sim move": "move teleport place",
    "teleop": "teleop_twist_keyboard key_teleop keyboard drive",
    "map save": "map_saver map_saver_cli",
    "goals": "send_goals waypoints patrol",
    "goto": "navigate move_base send_goal navigate_to_pose",
    "log": "rosout logs",
    "doctor": "roswtf wtf",
    "stop": "estop emergency_stop down end halt kill quit shutdown",
}
"""Command or subcommand -> other words for it."""


def commands_called(word: str, command: str = "") -> list[str]:
    """The commands that are called `word` elsewhere, the shortest first; with `command`, its subcommands alone."""
    found = (own for own, words in MEANT.items() if word in words.split() and own.startswith(command))
    return sorted(found, key=len)
