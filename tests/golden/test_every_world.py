"""Every available world is loaded, run for ten simulated seconds and drawn."""

import math
from pathlib import Path

import numpy as np
import pytest

from support.recordings import SHARED, WORLDS
from zteam.messages import Twist, Vector3
from zteam.sim import Engine
from zteam.simulator.world.drawing import draw_world
from zteam.world import load_world

STAGE = "benchmark/cave circuit fasr pioneer_flocking pioneer_follow pioneer_walle roomba sensor_noise_demo simple"
STAGE_ROS = "willow-erratic willow-four-erratics willow-four-erratics-multisensor willow-lesson3"
CRASH_STAGE = "camera everything"
"""Without a screen."""

OWN = [path for path in sorted(WORLDS.glob("*.world")) if path.stem != "unknown"]
THEIRS = [
    SHARED / "worlds" / folder / f"{name}.world"
    for folder, names in (("stage", f"{STAGE} {CRASH_STAGE}"), ("stage_ros", STAGE_ROS))
    for name in names.split()
]


@pytest.mark.few(4)
@pytest.mark.parametrize(
    "path", [*OWN, *(THEIRS if SHARED.is_dir() else [])], ids=lambda path: f"{path.parent.name}/{path.stem}"
)
def test_it_loads_runs_and_is_drawn(path: Path, tmp_path: Path) -> None:
    """Robots drive, numbers stay finite, and the picture is not empty."""
    world = load_world(path)
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
    assert not moved or np.mean(moved) > 0.5
    for suffix in ("svg", "png"):
        picture = tmp_path / f"world.{suffix}"
        draw_world(world, picture, width=400)
        assert picture.stat().st_size > 500
