"""A simulation with a real engine, on a bus in memory and without a main loop."""

from support.in_process_team import SCENE, load_scene
from zteam import names
from zteam.bus import MemoryHub
from zteam.messages import Message
from zteam.node.process_node import ProcessNode
from zteam.node.process_options import SimOptions
from zteam.node.shutdown import Stop
from zteam.simulator.process.simulation import Simulation


class SimulatorParts(Simulation):
    """Three robots in a shipped world, in real time."""

    def __init__(self, hub: MemoryHub, run_for: float | None = None) -> None:
        world, robots = load_scene()
        self.node = ProcessNode(names.SIMULATOR, hub.bus(), Stop())
        super().__init__(self.node, world, robots, SimOptions(SCENE, run_for=run_for, follows={1: 0}))
        self._hub = hub
        self.match_robots()

    def record(self, key_expr: str, message_type: type[Message]) -> list[str]:
        """The keys of messages as they arrive on `key_expr`."""
        keys: list[str] = []
        self._hub.bus().subscribe(key_expr, message_type, lambda key, _: keys.append(key))
        return keys

    def whole_tick(self) -> bool:
        """Take and send a tick without commands; whether the run is over with it."""
        self.tick({})
        self.count()
        self.send_rest()
        return self.boundary.finished

    def close(self) -> None:
        """End the node."""
        self.node.close()
