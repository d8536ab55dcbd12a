"""A whole team in one process, in lock-step on a bus in memory: simulator, aggregator, three robots in a chain, GO.

Only the simulator has a thread: in lock-step the other nodes act in the handlers of messages, which this bus calls in
the sender's thread.
"""

import threading
from collections.abc import Callable, Sequence
from typing import Any, Self

import msgspec

from support.limits import ASKED, LIMIT
from support.lockstep_doubles import ScriptedMonitor
from zteam import names
from zteam.bus import Bus, Change, MemoryHub
from zteam.config.resources import find_world
from zteam.geometry import Pose2
from zteam.messages import Done, RobotStatus, Tick
from zteam.node.node import Node
from zteam.node.process_node import ProcessNode
from zteam.node.process_options import AggregatorOptions, LockStepOptions, RobotOptions, SimOptions
from zteam.node.shutdown import Stop
from zteam.robot.behaviors.registry import find_behavior
from zteam.robot.process.node import RobotNode
from zteam.simulator.client import FinishReply, SimReport, SimStatus, StepRequest, WaitRequest
from zteam.simulator.process.node import open_simulation, run_ticks
from zteam.transforms.process.node import Aggregator
from zteam.world import Robot, World, add_robot, load_world

NAMES = ("tf", "robot_0", "robot_1", "robot_2")
ROBOTS = 3
SCENE = find_world("arena")


def load_scene() -> tuple[World, dict[int, Robot]]:
    """A shipped world with three robots."""
    world = load_world(SCENE)
    third = add_robot(world, "erratic", Pose2(-3.5, 1.5, 0.0), "robot_2")
    return world, dict(enumerate((*world.robots, third)))


class TeamOptions(msgspec.Struct, frozen=True, kw_only=True):
    """The options that tests vary."""

    order: tuple[str, ...] = NAMES
    """The order in which the processes come up."""
    staggered: bool = False
    """Whether each process comes up after the previous one has answered the held first tick; else all come up before
    the first tick."""
    seed: int = 1
    speed: float = 0.8
    """Speed of the first robot, m/s."""
    run_for: float | None = 10.0
    gate: bool = True
    """Whether robots and simulator wait for GO."""
    standing_go: bool = False
    """Whether GO was given before the team comes up."""
    pace: float | None = None
    paused: bool = False


class InProcessTeam:
    """The team. Its simulator runs inside `with`."""

    def __init__(self, options: TeamOptions | None = None, open_bus: Callable[[MemoryHub, str], Bus] | None = None):
        """`open_bus(hub, name)` opens the session of a process."""
        self.options = options = options or TeamOptions()
        self.hub = MemoryHub()
        self.bus = self.hub.bus()
        self._open_bus = open_bus or (lambda hub, _: hub.bus())
        self.dones: list[tuple[str, Done]] = []
        self.ticks: list[Tick] = []
        self.nodes: dict[str, ProcessNode] = {}
        self.texts: dict[str, str] = {}
        """The text of each robot's newest status."""
        self._ready: set[int] = set()
        self._monitor = ScriptedMonitor(self.hub)
        if options.standing_go:
            self._monitor.give_go()
        self.bus.subscribe(names.done_key("*"), Done, lambda key, done: self.dones.append((key.split("/")[0], done)))
        self.bus.subscribe(names.all_robots_key(names.STATUS), RobotStatus, self._on_status)
        world, self.robots = load_scene()
        self.world = world
        self._simulator_node = ProcessNode(names.SIMULATOR, self._open_bus(self.hub, names.SIMULATOR), Stop())
        simulation = open_simulation(self._simulator_node, world, self.robots, self._sim_options())
        self._simulator_node.become_present()
        self._to_come = [*options.order]
        self.bus.subscribe(names.TICK, Tick, self._on_tick)
        if not options.staggered:
            self.bring(self._to_come)
        self._thread = threading.Thread(target=run_ticks, args=(simulation,))

    def _sim_options(self) -> SimOptions:
        options = self.options
        return SimOptions(
            SCENE,
            seed=options.seed,
            follows={1: 0, 2: 1},
            run_for=options.run_for,
            speed=options.pace,
            paused=options.paused,
            lockstep=LockStepOptions(tuple(sorted(options.order)), gate=options.gate),
        )

    def _on_status(self, _key: str, status: RobotStatus) -> None:
        self.texts[names.robot_name(status.robot_id)] = status.text
        (self._ready.add if status.is_ready else self._ready.discard)(status.robot_id)
        if len(self._ready) == ROBOTS and not self.options.standing_go:
            self._monitor.give_go()

    def _on_tick(self, _key: str, tick: Tick) -> None:
        self.ticks.append(tick)
        if self._to_come and self.nodes.keys() <= {name for name, _ in self.dones}:
            # This is the simulator's own thread, so no other thread can wait for one of its locks.
            self.bring([self._to_come[0]])

    def bring(self, process_names: Sequence[str]) -> None:
        """Make these processes, then let them take their names in this order."""
        process_names = [*process_names]
        for name in process_names:
            self.prepare(name)
        for name in process_names:
            self.nodes[name].become_present()

    def prepare(self, name: str) -> None:
        """Make a process that does not take its name yet."""
        self._to_come = [other for other in self._to_come if other != name]
        self.nodes[name] = self._make(name)

    def _make(self, name: str) -> ProcessNode:
        options = self.options
        node = Node(name, self._open_bus(self.hub, name), Stop())
        robot_id = names.robot_id_of(name)
        if robot_id is None:
            Aggregator(node, AggregatorOptions())
            return node
        if robot_id:
            behavior, params = "follow", {"leader": robot_id - 1}
        else:
            behavior, params = "wander", {"speed": options.speed, "hand_over": False}
        RobotNode(
            node,
            find_behavior(behavior),
            RobotOptions(robot_id, behavior, params, options.gate, options.seed),
        )
        return node

    def end(self, name: str) -> None:
        """End a process."""
        self.nodes.pop(name).close()

    def ask(self, service: str, reply: Any = SimStatus, request: msgspec.Struct | None = None) -> Any:
        """Query `sim/<service>`."""
        # The simulator's own limits end a request earlier, and say why.
        return self.bus.ask(names.service_key(names.SIMULATOR, service), reply, request or Change(), timeout=LIMIT)

    def step(self, ticks: int) -> SimStatus:
        """Take so many ticks; the status after them."""
        return self.ask("step", SimStatus, StepRequest(ticks))  # type: ignore[no-any-return]

    def finish(self, limit: float = ASKED) -> SimReport:
        """Wait for the end of `run_for`; the report."""
        finished = self.ask("finish", FinishReply, WaitRequest(limit)).finished
        assert finished, (self.ask("status").waiting_for, self.texts)
        return self.report()

    def report(self) -> SimReport:
        """The current report."""
        return self.ask("report", SimReport)  # type: ignore[no-any-return]

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._simulator_node.stop.request("test over")
        self._thread.join(LIMIT)
        assert not self._thread.is_alive()
        for node in [*self.nodes.values(), self._simulator_node]:
            node.close()


def run(**options: Any) -> SimReport:
    """Run a team to the end of `run_for`; its report."""
    with InProcessTeam(TeamOptions(**options)) as team:
        return team.finish()
