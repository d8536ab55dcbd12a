"""The map server's process: one map on `map`, kept for late subscribers.

It takes part in lock-step, so that all participants get the map as it is, before their first tick.
"""

from zteam import names
from zteam.errors import log
from zteam.messages import OccupancyGrid
from zteam.navigation.planning.grid import GridMap
from zteam.navigation.planning.maps import map_message
from zteam.node.node import Node
from zteam.node.steps import NoSteps


def run_map_server(node: Node, grid: GridMap, source: str) -> None:
    """Publish the map until the process is asked to stop; `source` is what the log calls it."""
    node.adopt(lambda due: None, NoSteps(node))
    publisher = node.bus.publisher(names.MAP, OccupancyGrid, latched=True)
    publisher.put(map_message(grid))
    node.become_present()
    frame = grid.frame
    log.info("serving %s: %d x %d cells of %g m", source, frame.columns, frame.rows, frame.resolution)
    node.drive(lambda: None)
