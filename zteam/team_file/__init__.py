"""Team files: TOML that is read into structs without unknown keys.

Every error is a ConfigError with one line per mistake: file, line, key, what is wrong and what is allowed.
"""

from zteam.team_file.entries import (
    DEFAULT_BEHAVIOR,
    NO_WORLD,
    RobotEntry,
    StaticTransform,
    Team,
    TeamSection,
    behavior_of,
    robot_arguments,
    static_transform,
)
from zteam.team_file.reading import TeamFile, load_team, read_team_file, team_world

__all__ = [
    "DEFAULT_BEHAVIOR",
    "NO_WORLD",
    "RobotEntry",
    "StaticTransform",
    "Team",
    "TeamFile",
    "TeamSection",
    "behavior_of",
    "load_team",
    "read_team_file",
    "robot_arguments",
    "static_transform",
    "team_world",
]
