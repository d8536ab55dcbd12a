"""Every world of the collection: loaded, run for ten simulated seconds, and drawn."""

import math
from pathlib import Path

import numpy as np
import pytest

from zteam.errors import WorldError
from zteam.messages import Twist, Vector3
from zteam.sim import Engine
from zteam.world import load_world
from zteam.world.drawing import draw_world

STAGE = "benchmark/cave circuit fasr pioneer_flocking pioneer_follow pioneer_walle roomba sensor_noise_demo simple"
STAGE_ROS = "willow-erratic willow-four-erratics willow-four-erratics-multisensor willow-lesson3"
LOADED = [f"stage/{name}" for name in STAGE.split()] + [f"stage_ros/{name}" for name in STAGE_ROS.split()]


@pytest.mark.parametrize("name", [*LOADED, "stage/camera", "stage/everything"])
def test_it_loads_runs_and_is_drawn(name: str, shared: Path, tmp_path: Path) -> None:
    """Also the two that crash Stage without a screen; everybody drives, and numbers stay finite."""
    world = load_world(shared / "worlds" / f"{name}.world")
    engine = Engine(world)
    start = [engine.truth(i) for i in engine.robots]
    for tick in range(math.ceil(10e9 / world.interval)):
        engine.move({i: Twist(Vector3(0.3), Vector3(0.0, 0.0, 0.5 * math.sin(0.05 * tick + i))) for i in engine.robots})
    seen = engine.observe()
    assert seen.stamp >= 10e9
    for one in seen.robots.values():
        assert all(map(math.isfinite, (*one.truth, *one.odom)))
        for ranger, reading in zip(one.robot.rangers, one.readings, strict=True):
            assert reading.ranges.shape == (ranger.samples,)
            assert np.isfinite(reading.ranges).all()
    moved = [math.dist(a[:2], engine.truth(i)[:2]) > 0.1 for i, a in enumerate(start)]
    assert np.mean(moved) > 0.5
    for suffix in ("svg", "png"):
        path = tmp_path / f"world.{suffix}"
        draw_world(world, engine.robots, path, width=400)
        assert path.stat().st_size > 1000


def test_an_unknown_model_type_is_an_error_with_its_place(shared: Path) -> None:
    """The one world of the collection that Stage itself refuses names the line that is at fault."""
    with pytest.raises(WorldError, match=r"wifi\.world:\d+:\d+: "):
        load_world(shared / "worlds" / "stage" / "wifi.world")
