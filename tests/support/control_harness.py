"""A main loop with a scripted simulation: a real boundary and real queries, and ticks that a test may hold."""

import threading
from typing import Any

import msgspec

from support.limits import LIMIT
from zteam import names
from zteam.bus import Change, MemoryHub
from zteam.clock import monotonic, wait_until
from zteam.errors import UsageError
from zteam.node.process_node import ProcessNode
from zteam.node.shutdown import Stop
from zteam.simulator.client import Latency, MoveRequest, ScansReply, SensedScan, SimReport, SimStatus, SpawnRequest
from zteam.simulator.process.node import serve_queries
from zteam.simulator.process.pacing import Pacer, TickBoundary

TICK = 1_000_000
"""Simulated nanoseconds."""


class ScriptedSimulation:
    """Counts ticks, and notes which changes were made, in which thread and when."""

    def __init__(self, boundary: TickBoundary, pacer: Pacer, instance: str) -> None:
        self.boundary, self.pacer, self._instance = boundary, pacer, instance
        self.changed = threading.Condition()
        self.tick = 0
        self.ticking = False
        self.made: list[tuple[str, int]] = []
        """Each change, and the tick after which it was made."""
        self.places: set[tuple[int, bool]] = set()
        """The threads in which changes were made, and whether that was within a tick."""

    def status(self) -> SimStatus:
        """The answer to `sim/status`."""
        return SimStatus(
            world="scripted",
            robots=[],
            interval=TICK,
            seed=1,
            now=self.tick * TICK,
            tick=self.tick,
            real_time_factor=1.0,
            speed=self.pacer.speed,
            paused=self.pacer.paused,
            finished=self.boundary.finished,
            instance=self._instance,
        )

    def report(self) -> SimReport:
        """The answer to `sim/report`."""
        return SimReport(
            sim_seconds=0.0,
            seed=1,
            external_commands=0,
            finished=self.boundary.finished,
            robots=[],
            latency_ms=Latency(None, None, 0),
            ticks=self.tick,
        )

    def note(self, change: str) -> None:
        """Note a change."""
        self.made.append((change, self.tick))
        self.places.add((threading.get_ident(), self.ticking))

    def repeat(self) -> None:
        """As `Simulation.repeat`."""
        self.note("repeat")

    def scans(self, robots: list[int]) -> ScansReply:
        """As `Simulation.scans`; each robot has one laser."""
        self.note(f"scans {robots}")
        return ScansReply([SensedScan(names.scan_key(robot_id, 0), b"scan") for robot_id in robots])

    def reset(self) -> None:
        """As `Simulation.reset`."""
        self.note("reset")
        self.tick = 0
        self.boundary.begin_anew()

    def spawn(self, request: SpawnRequest) -> int:
        """As `Simulation.spawn`; the robot is always number 7."""
        self.note(f"spawn {request.x:g}" + " by force" * request.force)
        return 7

    def remove(self, robot_id: int) -> None:
        """As `Simulation.remove`; there is no robot 9."""
        if robot_id == 9:
            raise UsageError("no robot 9 in this world")
        self.note(f"remove {robot_id}")

    def move(self, request: MoveRequest) -> None:
        """As `Simulation.move`."""
        self.note(f"move {request.id}" + " by force" * request.force)


class ControlHarness:
    """A main loop around a scripted simulation, and a client that asks it."""

    def __init__(self, pacer: Pacer) -> None:
        self.pacer = pacer
        self.hub = MemoryHub()
        self.bus = self.hub.bus()
        """The client's session."""
        self.stop = Stop()
        self.node = ProcessNode(names.SIMULATOR, self.hub.bus(), self.stop)
        self.boundary = TickBoundary(self.node, pacer)
        self.world = ScriptedSimulation(self.boundary, pacer, self.node.bus.instance)
        serve_queries(self.node.bus, self.world)
        self.free = threading.Event()
        """While it is cleared, the open tick does not end."""
        self.free.set()
        self.last: int | None = None
        """The tick that ends the run."""
        self._askers: list[threading.Thread] = []
        self.thread = threading.Thread(target=self._run)
        self.thread.start()

    def _run(self) -> None:
        world = self.world
        while True:
            self.pacer.start(monotonic())
            with world.changed:
                world.ticking = True
                world.tick += 1
                world.changed.notify_all()
            if world.tick == self.last:
                self.boundary.finish()
            assert self.free.wait(LIMIT)
            world.ticking = False
            if not self.boundary.wait_for_tick():
                return

    def wait_for_tick(self, tick: int) -> None:
        """Wait until this tick or a later one has begun."""
        with self.world.changed:
            assert wait_until(self.world.changed, lambda: self.world.tick >= tick, LIMIT)

    def ask(self, service: str, reply: Any = SimStatus, request: msgspec.Struct | None = None) -> Any:
        """Query `sim/<service>`."""
        return self.bus.ask(names.service_key(names.SIMULATOR, service), reply, request or Change(), timeout=LIMIT)

    def ask_aside(self, service: str, reply: Any, request: msgspec.Struct | None = None) -> list[Any]:
        """Query it in a thread: the list contains the answer as soon as it has come."""
        answers: list[Any] = []
        thread = threading.Thread(target=lambda: answers.append(self.ask(service, reply, request)))
        thread.start()
        self._askers.append(thread)
        return answers

    def join(self) -> None:
        """Wait for the answers of all `ask_aside`."""
        for thread in self._askers:
            thread.join(LIMIT)
            assert not thread.is_alive()
        self._askers.clear()

    def close(self) -> None:
        """End the main loop."""
        self.free.set()
        self.join()
        self.stop.request("test over")
        self.thread.join(LIMIT)
        assert not self.thread.is_alive()
        self.node.close()
