"""What of a team depends on the seed."""

from collections.abc import Iterator

from zteam import names
from zteam.behaviors.registry import DETERMINISTIC
from zteam.simulation_options import Options
from zteam.team_file import Team, behavior_of
from zteam.world import add_robot
from zteam.world.model import Robot, World


def random_parts(team: Team, world: World | None) -> list[str]:
    """What draws random numbers in a team, in words; empty if every seed gives the same run.

    A behaviour of the user's own counts, because it may.
    """
    parts = [] if world is None else _noise(team.simulation, list(_simulated(team, world)))
    behaviors = {behavior_of(entry)[0] for entry in team.robots}
    return [*parts, *sorted(behaviors - DETERMINISTIC)]


def _simulated(team: Team, world: World) -> Iterator[Robot]:
    if team.team.world_robots:
        yield from world.robots
    for entry in team.robots:
        if entry.model is not None and entry.pose is not None:
            yield add_robot(world, entry.model, entry.pose, names.robot_name(entry.id))


def _noise(options: Options, robots: list[Robot]) -> list[str]:
    rangers = [ranger for robot in robots for ranger in robot.rangers]
    found = {
        "noise of lasers": options.gaussian_noise or options.proportional_noise or any(any(r.noise) for r in rangers),
        "noise of odometry": any(any(options.odom_alphas or robot.odom_alphas) for robot in robots),
        "dazzle": options.dazzle != "off",
    }
    return [name for name, is_there in found.items() if is_there]
