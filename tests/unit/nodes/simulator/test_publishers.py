"""The simulator's publishers of one robot."""

import pytest

from support.in_process_team import load_scene
from zteam import names
from zteam.bus import MemoryHub
from zteam.nodes.simulator.publishers import RobotOutputs
from zteam.runtime.node import Node
from zteam.runtime.shutdown import Stop


@pytest.mark.parametrize("lockstep", [False, True])
def test_the_simulator_publishes_commands_in_lock_step_only(lockstep: bool) -> None:
    """In real time `cmd_vel` has no publisher but the robot, so tools do not take the simulator for one."""
    hub = MemoryHub()
    RobotOutputs(Node(names.SIMULATOR, hub.bus(), Stop()), 0, load_scene()[1][0], lockstep=lockstep)
    published = {declaration.key for declaration in hub.declarations() if declaration.publishes}
    assert "robot_0/odom" in published
    assert ("robot_0/cmd_vel" in published) is lockstep
