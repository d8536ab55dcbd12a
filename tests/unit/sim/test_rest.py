"""Bodies at rest: steps that change nothing are left out, and leave no trace."""

import numpy as np
import pytest

from support.small_worlds import drive, make_box, make_maze, make_robot
from zteam.geometry import Pose2
from zteam.messages import Twist
from zteam.sim import Engine
from zteam.sim.dynamic import DynamicBodies
from zteam.world.model import World


class NeverAtRest(DynamicBodies):
    """Steps whether there is anything to do or not."""

    @property
    def _rests(self) -> bool:
        return False

    @_rests.setter
    def _rests(self, rests: bool) -> None:
        pass


def make_crowd(seed: int, boxes: int) -> World:
    """Five robots close together in a maze, with things that can be pushed."""
    random = np.random.default_rng(seed)
    robots = [make_robot(*random.uniform(-0.7, 0.7, 2), random.uniform(-3.0, 3.0)) for _ in range(5)]
    things = tuple(make_box(f"b{i}", *random.uniform(-1.0, 1.0, 2), mass=1.0) for i in range(boxes))
    world = make_maze(*robots, seed=seed)
    return World(world.name, world.interval, world.floorplans, (*world.obstacles, *things), world.robots)


@pytest.mark.few(4)
@pytest.mark.parametrize("boxes", [0, 2])
@pytest.mark.parametrize("seed", range(8))
def test_steps_left_out_at_rest_leave_no_trace(seed: int, boxes: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Robots that drive, bump, stop for a while, are set down elsewhere and drive on: the same poses, to the bit."""
    engines = [Engine(make_crowd(seed, boxes))]
    engines[0].move({})
    monkeypatch.setattr("zteam.sim.dynamic.DynamicBodies", NeverAtRest)
    engines.append(Engine(make_crowd(seed, boxes)))
    engines[1].move({})
    random = np.random.default_rng(seed)
    for _ in range(12):
        drives = random.random() < 0.6
        commands = {i: drive(*random.uniform(-0.6, 0.6, 2)) if drives else Twist() for i in range(5)}
        if random.random() < 0.3:
            robot, pose = int(random.integers(5)), Pose2(*random.uniform(-0.7, 0.7, 2).tolist(), 0.5)
            for engine in engines:
                engine.place(robot, pose)
        for _ in range(int(random.integers(1, 12))):
            for engine in engines:
                engine.move(commands)
            one, other = (engine.standing() for engine in engines)
            np.testing.assert_array_equal(one.poses, other.poses)
            np.testing.assert_array_equal(one.stalled, other.stalled)


def test_a_world_at_rest_is_not_stepped(monkeypatch: pytest.MonkeyPatch) -> None:
    """Robots that stand cost no step of the solver; the first command is carried out at once."""
    engine = Engine(make_maze(make_robot()))
    for _ in range(2):
        engine.move({0: Twist()})
    space = engine._assembled().bodies._space  # type: ignore[attr-defined]
    before = space.current_time_step
    steps: list[float] = []
    monkeypatch.setattr(type(space), "step", lambda _self, dt: steps.append(dt))
    engine.move({0: Twist()})
    assert steps == []
    engine.move({0: drive(0.5)})
    assert steps
    assert before > 0.0
