"""The map server's process: one map on `map`, kept for late subscribers."""

from zteam import names
from zteam.errors import log
from zteam.messages import OccupancyGrid
from zteam.navigation.planning.grid import GridMap
from zteam.navigation.planning.maps import map_message
from zteam.node.process_node import ProcessNode


def run_map_server(node: ProcessNode, grid: GridMap, source: str) -> None:
    """Publish the map until the process is asked to stop; `source` is what the log calls it."""
    node.become_present()
    publisher = node.bus.publisher(names.MAP, OccupancyGrid, latched=True)
    publisher.put(map_message(grid))
    frame = grid.frame
    log.info("serving %s: %d x %d cells of %g m", source, frame.columns, frame.rows, frame.resolution)
    while not node.stopping:
        node.wait(lambda: False, 60.0)
