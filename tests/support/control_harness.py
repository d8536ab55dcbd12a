"""A simulator's main loop by script: ticks that the test may hold, around the real queries."""

import threading
from typing import Any

import msgspec

from support.lockstep_doubles import LIMIT
from zteam import names
from zteam.bus import Change, MemoryHub
from zteam.clock import monotonic, wait_until
from zteam.errors import UsageError
from zteam.nodes.simulator.pacing import Pacer
from zteam.nodes.simulator.queries import Control
from zteam.runtime.node import Node
from zteam.runtime.shutdown import Stop
from zteam.services.simulator import Latency, MoveRequest, SimReport, SimStatus, SpawnRequest

TICK = 1_000_000
"""Simulated nanoseconds."""


class World:
    """Counts ticks, and notes what it is told, where and when."""

    def __init__(self, pacer: Pacer) -> None:
        self._pacer = pacer
        self.changed = threading.Condition()
        self.tick = 0
        self.ticking = False
        self.made: list[tuple[str, int]] = []
        """What changed, and after which tick."""
        self.places: set[tuple[int, bool]] = set()
        """In which threads, and whether that was within a tick."""

    def status(self) -> SimStatus:
        return SimStatus(
            "scripted", [], TICK, 1, self.tick * TICK, self.tick, 1.0, self._pacer.speed, self._pacer.paused
        )

    def report(self) -> SimReport:
        return SimReport(
            sim_seconds=0.0,
            seed=1,
            external_commands=0,
            finished=False,
            robots=[],
            latency_ms=Latency(None, None, 0),
            ticks=self.tick,
        )

    def note(self, what: str) -> None:
        self.made.append((what, self.tick))
        self.places.add((threading.get_ident(), self.ticking))

    def repeat(self) -> None:
        self.note("repeat")

    def reset(self) -> None:
        self.note("reset")
        self.tick = 0

    def spawn(self, request: SpawnRequest) -> int:
        self.note(f"spawn {request.x:g}" + " by force" * request.force)
        return 7

    def remove(self, robot_id: int) -> None:
        if robot_id == 9:
            raise UsageError("no robot 9 in this world")
        self.note(f"remove {robot_id}")

    def move(self, request: MoveRequest) -> None:
        self.note(f"move {request.id}" + " by force" * request.force)


class Desk:
    """A simulator's main loop around that world, ticks that the test may hold, and an asker."""

    def __init__(self, pacer: Pacer) -> None:
        self.pacer = pacer
        self.hub = MemoryHub()
        self._bus = self.hub.bus()
        self.stop = Stop()
        self.node = Node(names.SIMULATOR, self.hub.bus(), self.stop)
        self.world = World(pacer)
        self.control = Control(self.node, self.world, pacer)
        self.free = threading.Event()
        """Cleared, the tick at hand does not end."""
        self.free.set()
        self.last: int | None = None
        """The tick with which the run is over."""
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
                self.control.finish()
            assert self.free.wait(LIMIT)
            world.ticking = False
            if not self.control.wait_for_turn():
                return

    def wait_for_tick(self, tick: int) -> None:
        """Wait until this one has begun, or a later one."""
        with self.world.changed:
            assert wait_until(self.world.changed, lambda: self.world.tick >= tick, LIMIT)

    def ask(self, service: str, reply: Any = SimStatus, request: msgspec.Struct | None = None) -> Any:
        """Query `sim/<service>`."""
        return self._bus.ask(names.service_key(names.SIMULATOR, service), reply, request or Change(), timeout=LIMIT)

    def ask_aside(self, service: str, reply: Any, request: msgspec.Struct | None = None) -> list[Any]:
        """Query it in a thread: the list has the answer once it came."""
        answers: list[Any] = []
        thread = threading.Thread(target=lambda: answers.append(self.ask(service, reply, request)))
        thread.start()
        self._askers.append(thread)
        return answers

    def join(self) -> None:
        """Wait for everybody who asks aside."""
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
        self.node.close()
