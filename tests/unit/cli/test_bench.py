"""What `zteam bench` measures, and how it is shown."""

import math

import numpy as np
import pytest

from zteam.cli.bench import figure, format_figures
from zteam.cli.bench_team import (
    APART,
    GAP,
    InProcessFigures,
    TeamFigures,
    find_circuit,
    make_laser,
    measure_simulation,
    place_robots,
)
from zteam.config.resources import find_world
from zteam.config.simulation_options import Options
from zteam.errors import UsageError
from zteam.node.lockstep import RoundTiming
from zteam.robot.behaviors.path import Polyline
from zteam.simulator.client import Timing
from zteam.world import load_world


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
    team = TeamFigures(
        world="office", robots=1, beams=1081, lockstep=True, rtf=44.61234, ticks_per_s=446.1234,
        timing_ms=Timing(1.17345, 0.20712, 0.15634, 0.64678, 0.0130001),
        rounds={"robot_0": RoundTiming(300, 0.0070749998, 0.1999)},
        go_after_seconds=2.34, latency_p50_ms=1.0912, latency_p99_ms=3.2134, lateness_p99_ms=None, late_steps=1,
        resends=0, trajectory_sha256="29c3", pss_mb=217.6, cpu_seconds={"sim": 0.87, "robot_0": 0.28}, dropped=2,
        least_driven_m=14.93, in_process=InProcessFigures(150.0, 440.0, 71.4, True, 210.0),
    )  # fmt: skip
    rows = dict(line.split() for line in format_figures(team).splitlines())
    assert rows["rtf"] == "44.6" and rows["robots"] == "1" and "lateness_p99_ms" not in rows
    assert rows["rounds.robot_0.inputs"] == "0.00707" and rows["cpu_seconds.sim"] == "0.870"
    assert rows["in_process.core_rtf"] == "440" and rows["in_process.same_trajectory"] == "True"


def test_the_core_is_measured() -> None:
    """As many ticks, rays and robots as were asked for; the figures belong together."""
    world, laser = load_world(find_world("arena")), make_laser(11, 180.0, 5.0)
    assert (laser.samples, laser.fov, laser.range_max) == (11, pytest.approx(math.pi), 5.0)
    found = measure_simulation(world, 2, laser, 1.0, Options())
    assert (found.robots, found.beams, found.seconds) == (2, 11, 1.0)
    ticks = 1e9 / world.interval
    assert found.step_ms == pytest.approx(1e3 / found.rtf / ticks)
    assert found.rays_per_s == pytest.approx(ticks * 2 * 11 * found.rtf)
    assert place_robots(world, 3, 1) == place_robots(world, 3, 1) != place_robots(world, 3, 2)


@pytest.mark.parametrize(("name", "robots"), [("office", 20), ("arena", 4)])
def test_a_circuit_is_found(name: str, robots: int) -> None:
    """It closes, has room for the chain, meets itself nowhere, and is the same each time."""
    world = load_world(find_world(name))
    waypoints = find_circuit(world, GAP * (robots - 1))
    if name == "arena":
        assert waypoints == find_circuit(world, GAP * (robots - 1))
    circuit = Polyline([*waypoints, waypoints[0]])
    assert circuit.end > GAP * (robots - 1) + 5.0
    places = np.arange(0.0, circuit.end, 0.2)
    points = np.array([circuit.at(place)[:2] for place in places])
    steps = np.hypot(*(points - np.roll(points, 1, axis=0)).T)
    assert steps.max() < 0.21
    along = np.abs(places[:, None] - places)
    parts = np.minimum(along, circuit.end - along) > 5.0
    assert np.hypot(*(points[:, None] - points).T)[parts.T].min() > APART - 0.1
    headings = np.unwrap([circuit.at(place).yaw for place in places])
    assert np.abs(np.diff(headings)).max() < 0.8
    assert abs(headings[-1] - headings[0]) == pytest.approx(math.tau, abs=0.8)


@pytest.mark.ci
def test_a_world_without_room_is_refused() -> None:
    """The text has the world and the length that is needed."""
    with pytest.raises(UsageError, match=r"world arena has no way round of 87\.2 m"):
        find_circuit(load_world(find_world("arena")), GAP * 99)
