"""The simulator's publishers of one robot."""

import pytest

from support.in_process_team import load_scene
from zteam.bus import MemoryHub
from zteam.messages import Bool, LaserScan, Odometry, Twist
from zteam.sim import Engine
from zteam.simulator.process.outputs import RobotOutputs, TeamOutputs


@pytest.mark.parametrize("lockstep", [False, True])
def test_the_simulator_publishes_commands_in_lock_step_only(lockstep: bool) -> None:
    """In real time `cmd_vel` has no publisher but the robot, so tools do not take the simulator for one."""
    hub = MemoryHub()
    RobotOutputs(hub.bus(), 0, load_scene()[1][0], lockstep=lockstep)
    published = {declaration.key for declaration in hub.bus().declarations() if declaration.publishes}
    assert "robot_0/odom" in published
    assert ("robot_0/cmd_vel" in published) is lockstep


def test_what_has_subscribers_is_published_and_nothing_else(hub: MemoryHub) -> None:
    """Subscribers that come and go between two ticks count from the next one on."""
    world, robots = load_scene()
    engine = Engine(world, robots=robots)
    outputs = TeamOutputs(hub.bus(), engine, lockstep=True)
    outputs.match_robots()
    observation = engine.observe()
    heard: list[str] = []
    types = {"robot_0/odom": Odometry, "robot_0/base_scan": LaserScan, "robot_0/stall": Bool, "robot_0/cmd_vel": Twist}
    for expected in ([], [*types], ["robot_0/stall"], ["robot_0/odom"], []):
        handles = [hub.bus().subscribe(key, types[key], lambda key, _: heard.append(key)) for key in expected]
        outputs[0].put(outputs[0].odom, observation)
        outputs[0].put(outputs[0].scans, observation)
        outputs[0].put_rest(observation)
        outputs.put_commands({0: Twist()})
        assert heard == expected
        heard.clear()
        for handle in handles:
            handle.close()
