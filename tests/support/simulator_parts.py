"""The parts of a simulator around a real engine, on a bus in memory and without a main loop."""

from support.in_process_team import load_scene
from zteam import names
from zteam.bus import MemoryHub
from zteam.messages import Message
from zteam.nodes.simulator.commands import Commands
from zteam.nodes.simulator.pacing import Pacer
from zteam.nodes.simulator.reports import Reporter
from zteam.nodes.simulator.run_counter import RunCounter
from zteam.nodes.simulator.run_statistics import RunStatistics
from zteam.nodes.simulator.team_outputs import TeamOutputs
from zteam.nodes.simulator.tick_profile import TickProfile
from zteam.nodes.simulator.tick_sender import TickSender
from zteam.nodes.simulator.world_changes import WorldChanges
from zteam.runtime.process_node import ProcessNode
from zteam.runtime.shutdown import Stop
from zteam.services.simulator import MapInfo
from zteam.sim import Engine


class SimulatorParts:
    """Three robots in a shipped world, in real time."""

    def __init__(self, hub: MemoryHub, run_for: float | None = None) -> None:
        self.world, robots = load_scene()
        self.node = ProcessNode(names.SIMULATOR, hub.bus(), Stop())
        self.engine = Engine(self.world, seed=1, robots=robots)
        self.profile = TickProfile()
        self.pacer = Pacer(self.world.interval)
        self.statistics = RunStatistics({1: 0})
        self.outputs = TeamOutputs(self.node, self.engine)
        self.commands = Commands(self.node, self.outputs.__contains__, self.statistics)
        self.counter = RunCounter(self.engine, self.outputs, self.statistics, self.profile, self.pacer, run_for)
        self.sender = TickSender(self.node, self.engine, self.outputs, self.commands, None, self.profile)
        self.resets: list[str] = []
        """Grows with every reset."""
        self.changes = WorldChanges(
            self.world,
            self.engine,
            self.outputs,
            self.sender,
            [self.counter.start_anew, self.sender.start_anew, lambda: self.resets.append("reset")],
        )
        self.reporter = Reporter(
            self.world,
            MapInfo(0.0, 0.0, 0.0, 0.05, 1, 1),
            1,
            "session",
            self.engine,
            self.commands,
            self.pacer,
            None,
            self.statistics,
            self.profile,
        )
        self._hub = hub
        self.outputs.match_robots()

    def record(self, key_expr: str, message_type: type[Message]) -> list[str]:
        """The keys of messages as they arrive on `key_expr`."""
        keys: list[str] = []
        self._hub.bus().subscribe(key_expr, message_type, lambda key, _: keys.append(key))
        return keys

    def tick(self) -> bool:
        """Take and send a tick without commands; whether the run is over with it."""
        self.engine.move({})
        self.sender.send_inputs()
        over = self.counter.count()
        self.sender.send_rest()
        return over

    def close(self) -> None:
        """End the node."""
        self.node.close()
