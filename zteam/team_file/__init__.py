"""Team files: TOML that is read into structs without unknown keys.

Every error is a ConfigError with one line per mistake: file, line, key, what is wrong and what is allowed.
"""

from zteam.team_file.entries import (
    DEFAULT_BEHAVIOR,
    NO_WORLD,
    NodeEntry,
    RobotEntry,
    StaticTransform,
    Team,
    TeamSection,
    behavior_of,
    navigation_of,
    static_transform,
)
from zteam.team_file.groups import GROUP_KEYS
from zteam.team_file.reading import TeamFile, load_team, read_team_file, read_team_tables, team_world
from zteam.team_file.sources import argument_texts, describe_arguments, error_of, parse_arguments

__all__ = [
    "DEFAULT_BEHAVIOR",
    "GROUP_KEYS",
    "NO_WORLD",
    "NodeEntry",
    "RobotEntry",
    "StaticTransform",
    "Team",
    "TeamFile",
    "TeamSection",
    "argument_texts",
    "behavior_of",
    "describe_arguments",
    "error_of",
    "load_team",
    "navigation_of",
    "parse_arguments",
    "read_team_file",
    "read_team_tables",
    "static_transform",
    "team_world",
]
