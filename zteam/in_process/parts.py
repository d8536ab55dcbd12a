"""What each node of a team in one process does: as the process of its kind does, with the same options."""

from collections.abc import Callable

from zteam.launch.kinds import KINDS, TeamLaunch
from zteam.nodes.bodies import Part, part_of, printing_monitor
from zteam.process_options import MonitorOptions, ProcessOptions, RobotOptions
from zteam.runtime.process_node import ProcessNode


def _part(options: ProcessOptions, say: Callable[[str], None]) -> Part:
    if isinstance(options, MonitorOptions):
        return printing_monitor(options, say)
    if isinstance(options, RobotOptions):
        robot = options

        def body(node: ProcessNode) -> None:
            # In the node's own thread: a mistake in the user's code ends that node, and may be gone at a restart.
            part_of(robot).body(node)

        return Part(body)
    return part_of(options)


def parts_of(launch: TeamLaunch, say: Callable[[str, str], None]) -> dict[str, Part]:
    """The parts of a simulated team, by the names of the nodes; `say(name, line)` prints a line of a node."""
    return {
        name: _part(options, lambda line, name=name: say(name, line))  # type: ignore[misc]
        for kind in KINDS
        if not kind.beside
        for name, options in kind.options(launch).items()
    }
