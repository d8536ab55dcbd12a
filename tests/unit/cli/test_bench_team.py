"""Closed ways through worlds."""

import math

import numpy as np
import pytest

from zteam.cli.bench_team import APART, GAP, find_circuit
from zteam.config.resources import find_world
from zteam.errors import UsageError
from zteam.robot.behaviors.polyline import Polyline
from zteam.world import load_world


@pytest.mark.parametrize(("name", "robots"), [("office", 20), ("arena", 4)])
def test_a_circuit_is_found(name: str, robots: int) -> None:
    """It closes, has room for the chain, meets itself nowhere, and is the same each time."""
    world = load_world(find_world(name))
    waypoints = find_circuit(world, GAP * (robots - 1))
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
