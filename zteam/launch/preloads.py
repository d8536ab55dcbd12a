"""What a warm parent imports before it forks: what the commands of a team import anyway.

What robots, aggregator and monitor need, and what the simulator shares with them. A missing entry costs its children
time and memory, no more.
"""

from collections.abc import Sequence

_ROUTER = ("zteam.cli.options", "zteam.nodes.router.node")
_NODE = ("zteam.cli.options", "zteam.runtime.process")
PRELOADS = {
    "zteam.cli.zteam_router": _ROUTER,
    "zteam.cli.zteam_sim": (*_NODE, "zteam.world"),
    "zteam.cli.zteam_tf": (*_NODE, "zteam.nodes.transforms.node", "zteam.team_file", "zteam.tf.urdf"),
    "zteam.cli.zteam_monitor": (*_NODE, "zteam.nodes.monitor.node"),
    "zteam.cli.zteam_nav": (*_NODE, "zteam.runtime.step_node", "zteam.team_file"),
    "zteam.cli.zteam_robot": (*_NODE, "zteam.nodes.robot.node", "zteam.behaviors.registry"),
}
"""Module that a child runs -> modules that are imported before it is forked, in the order of starting.

The simulator decides when a team can go, so it is forked before what the others need is imported.
"""


def all_preloads() -> tuple[str, ...]:
    """All modules, each once, in their order."""
    return tuple(dict.fromkeys(module for modules in PRELOADS.values() for module in modules))


def preloads_of(command: Sequence[str]) -> tuple[str, ...]:
    """What the child with this command line needs before it is forked."""
    return PRELOADS.get(command[3], all_preloads())
