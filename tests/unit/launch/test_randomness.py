"""What of a team depends on the seed."""

import inspect
from pathlib import Path

import pytest

from zteam.behaviors.registry import BEHAVIORS, DETERMINISTIC
from zteam.launch.randomness import random_parts
from zteam.resources import find_world
from zteam.team_file import load_team
from zteam.world import load_world

NOISY = """
define noisy position ( size [0.4 0.4 0.2] ranger ( sensor ( noise [0.01 0 0] ) ) odom_alphas [0.1 0 0 0] )
"""


@pytest.mark.parametrize(
    ("robot", "simulation", "parts"),
    [
        ("", "", []),
        ("follow = 1", "", []),
        ('behavior = "avoid"', "dazzle_angle = 0.1", []),
        ('behavior = "wander"', "", ["wander"]),
        ('behavior = "mine:Own"', "", ["mine:Own"]),
        ('behavior = "installed"', "", ["installed"]),
        ("", "gaussian_noise = 0.01", ["noise of lasers"]),
        ("", "proportional_noise = 0.01", ["noise of lasers"]),
        ("", "odom_alphas = [0.0, 0.1, 0.0, 0.0]", ["noise of odometry"]),
        ("", 'dazzle = "drop"', ["dazzle"]),
    ],
)
def test_what_draws_random_numbers(robot: str, simulation: str, parts: list[str], tmp_path: Path) -> None:
    """Noise and dazzle of the team file, and every behaviour but the shipped ones without chance."""
    path = tmp_path / "team.toml"
    path.write_text(f"[[robots]]\nid = 0\n{robot}\n[[robots]]\nid = 1\n[simulation]\n{simulation}\n")
    assert random_parts(load_team(path), load_world(find_world("arena"))) == parts


def test_noise_of_the_world_counts_where_its_robots_are(tmp_path: Path) -> None:
    """The world's own robots count unless the team leaves them out, and so do the robots that the team adds."""
    world, team = tmp_path / "noisy.world", tmp_path / "team.toml"
    world.write_text(NOISY + "noisy ( pose [0 0 0 0] )\n")
    noise = ["noise of lasers", "noise of odometry"]
    team.write_text("[[robots]]\nid = 0\n")
    assert random_parts(load_team(team), load_world(world)) == noise
    assert random_parts(load_team(team), None) == []
    added = '[team]\nworld_robots = false\n[[robots]]\nid = 0\npose = [0.0, 0.0, 0.0]\nmodel = "{}"\n'
    team.write_text(added.format("erratic"))
    assert random_parts(load_team(team), load_world(world)) == []
    team.write_text(added.format("noisy"))
    assert random_parts(load_team(team), load_world(world)) == noise


@pytest.mark.parametrize("name", BEHAVIORS)
def test_the_shipped_behaviours_without_chance_are_listed(name: str) -> None:
    """A behaviour that draws from its view must not be in the list, and every other one must be."""
    module = inspect.getmodule(BEHAVIORS[name])
    assert module is not None
    assert ("view.random" in inspect.getsource(module)) == (name not in DETERMINISTIC)
