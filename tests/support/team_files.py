"""Team files that a test writes."""

from pathlib import Path

from zteam.team.file.entries import Team
from zteam.team.file.reading import load_team

WHOLE = """
[team]
world = "none"
seed = 7

[[robots]]
id = 0
behavior = "wander"
speed = 0.4

[[robots]]
id = 1
follow = 0

[[robots]]
id = 7
model = "erratic"
pose = [2, 3.5, 1.57]

[[static_transforms]]
parent = "/robot_0/base_link"
child = "robot_0/camera"
x = 0.1
yaw = 1.5

[[static_transforms]]
parent = "map"
child = "dock"
qz = 0.7071
qw = 0.7071
qx = 0
qy = 0.0
"""
"""A team file with every kind of table."""


def load(folder: Path, text: str) -> Team:
    """The team in a file of this text."""
    path = folder / "team.toml"
    path.write_text(text, encoding="utf-8")
    return load_team(path)


def robots(*tables: str) -> str:
    """A file of these [[robots]] tables."""
    return "\n".join(f"[[robots]]\n{table}" for table in tables)
