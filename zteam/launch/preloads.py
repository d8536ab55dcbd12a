"""What a warm parent imports before it forks: what the commands of a team import anyway.

What robots, aggregator and monitor need, and what the simulator shares with them. A missing entry costs its children
time and memory, no more.
"""

from collections.abc import Sequence

_ROUTER = ("zteam.cli.options", "zteam.nodes.router.node")
# argparse imports shutil when it reads a command line.
_NODE = ("zteam.cli.options", "shutil", "zteam.runtime.process")
VIEW = "zteam.cli.zteam_view"
"""Teams are started without it, usually, so its modules are imported only for those with one."""
PRELOADS = {
    "zteam.cli.zteam_router": _ROUTER,
    "zteam.cli.zteam_sim": (*_NODE, "zteam.world"),
    "zteam.cli.zteam_tf": (*_NODE, "zteam.nodes.transforms.node", "zteam.team_file", "zteam.tf.urdf"),
    "zteam.cli.zteam_monitor": (*_NODE, "zteam.nodes.monitor.node"),
    "zteam.cli.zteam_robot": (
        *_NODE,
        "zteam.nodes.robot.node",
        "zteam.behaviors.registry",
        "zteam.messages.team_codecs",
        "zteam.cli.zteam_robot",
    ),
    "zteam.cli.zteam_nav": (*_NODE, "zteam.runtime.step_node", "zteam.team_file"),
    VIEW: (*_NODE, "zteam.nodes.web.node"),
}
"""Module that a child runs -> modules that are imported before it is forked, in the order of starting.

The simulator decides when a team can go, so it is forked before what the others need is imported.
"""


def all_preloads(*, view: bool = False) -> tuple[str, ...]:
    """All modules, each once, in their order; those of the view last, if at all."""
    rows = [modules for command, modules in PRELOADS.items() if view or command != VIEW]
    return tuple(dict.fromkeys(module for modules in rows for module in modules))


def preloads_of(command: Sequence[str]) -> tuple[str, ...]:
    """What the child with this command line needs before it is forked."""
    return PRELOADS.get(command[3], all_preloads())
