"""What `zteam bench` measures, and how it is shown."""

import math

import numpy as np
import pytest
from msgspec.structs import replace

from zteam.cli.bench import (
    GAP,
    figure,
    find_circuit,
    format_figures,
    make_laser,
    measure_simulation,
    on_circle,
    place_robots,
)
from zteam.config.resources import find_world
from zteam.config.simulation_options import Options
from zteam.errors import UsageError
from zteam.node.lockstep import RoundTiming
from zteam.simulator.world import add_robot, load_world
from zteam.simulator.world.placing import find_hindrance


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "-"),
        (0.0, "0.00"),
        (0.3, "0.300"),
        (0.013, "0.0130"),
        (99.96, "100"),
        (1.2e6, "1,200,000"),
    ],
)
def test_a_figure_has_three_digits(value: float | None, text: str) -> None:
    """Neither noise behind them nor an exponent, and no figure at all is a dash."""
    assert figure(value) == text


def test_figures_are_a_table() -> None:
    """A row for each that was measured, those of the parts of a team under the names of both."""
    team = {
        "robots": 1,
        "rtf": 44.61234,
        "lateness_p99_ms": None,
        "rounds": {"robot_0": RoundTiming(300, 0.0070749998, 0.1999)},
        "cpu_seconds": {"sim": 0.87},
        "in_process": {"core_rtf": 440.0, "same_trajectory": True},
    }
    rows = dict(line.split() for line in format_figures(team).splitlines())
    assert rows["rtf"] == "44.6" and rows["robots"] == "1" and "lateness_p99_ms" not in rows
    assert rows["rounds.robot_0.inputs"] == "0.00707" and rows["cpu_seconds.sim"] == "0.870"
    assert rows["in_process.core_rtf"] == "440" and rows["in_process.same_trajectory"] == "True"


def test_the_core_is_measured() -> None:
    """As many ticks, rays and robots as were asked for; the figures belong together."""
    world, laser = load_world(find_world("arena")), make_laser(11, 180.0, 5.0)
    assert (laser.samples, laser.fov, laser.range_max) == (11, pytest.approx(math.pi), 5.0)
    found = measure_simulation(world, 2, laser, 1.0, Options())
    assert (found["robots"], found["beams"], found["seconds"]) == (2, 11, 1.0)
    ticks = 1e9 / world.interval
    assert found["step_ms"] == pytest.approx(1e3 / found["rtf"] / ticks)
    assert found["rays_per_s"] == pytest.approx(ticks * 2 * 11 * found["rtf"])
    found = measure_simulation(world, 3, None, 1.0, Options(physics="kinematic"), driving=0.4)
    assert (found["driving"], found["beams"], found["physics"], found["rays_per_s"]) == (1, 0, "kinematic", 0.0)
    assert place_robots(world, 3, 1) == place_robots(world, 3, 1) != place_robots(world, 3, 2)


@pytest.mark.parametrize(("name", "robots"), [("office", 20), ("arena", 4)])
def test_a_circuit_is_found(name: str, robots: int) -> None:
    """It has room for the chain and for a robot anywhere on it, and is the same each time."""
    world = load_world(find_world(name))
    centre, radius = found = find_circuit(world, robots)
    if name == "arena":
        assert found == find_circuit(world, robots)
    assert math.tau * radius > GAP * robots
    robot = add_robot(world, "erratic", centre, "bench")
    for turn in np.arange(0.0, math.tau, 0.1).tolist():
        pose = on_circle(centre, radius, turn)
        assert math.dist(pose[:2], centre[:2]) == pytest.approx(radius)
        assert not find_hindrance(world, replace(robot, pose=pose), {})


@pytest.mark.ci
def test_a_world_without_room_is_refused() -> None:
    """The text has the world and the room that is needed."""
    with pytest.raises(UsageError, match=r"world arena has no room for a circle of 13\.1 m"):
        find_circuit(load_world(find_world("arena")), 101)
