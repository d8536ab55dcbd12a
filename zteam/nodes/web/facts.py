"""What the view asks for, because nothing publishes it: the simulator's status and shapes, restarts, presence."""

import logging
from collections.abc import Callable
from typing import Any, TypeVar

from zteam import names
from zteam.bus import Bus
from zteam.bus.transport import Closeable
from zteam.clock import monotonic
from zteam.errors import BusError
from zteam.runtime.node import Node
from zteam.runtime.tokens import TokenSet
from zteam.services.simulator import ObstaclesReply, ShapesReply, SimStatus

log = logging.getLogger("zteam")

T = TypeVar("T")

PERIOD = 0.5
"""Host seconds between two looks at the simulator while a page is open."""
PATIENCE = 1.0


class Facts:
    """`ask` is called on a thread of its own, which may wait for answers. What it finds is replaced as a whole."""

    def __init__(self, node: Node, on_news: Callable[[], None]) -> None:
        self._node, self._bus, self._on_news = node, node.bus, on_news
        self._tokens = TokenSet()
        self._watch: list[Closeable] = []
        self.link_up = True
        self.sim: SimStatus | None = None
        self.sim_time = 0.0
        """Host time of that answer."""
        self.shapes: ShapesReply | None = None
        self.obstacles: ObstaclesReply | None = None
        self._shapes_of: Any = None
        node.bus.watch_link(self._on_link)

    def _on_link(self, up: bool) -> None:
        self.link_up = up
        self._on_news()

    def watch(self, wanted: bool) -> None:
        """Hear which processes are there, or hear it no more."""
        if wanted and not self._watch:
            self._watch = self._bus.watch_tokens([names.tokens_key()], self._on_token)
        elif not wanted and self._watch:
            for watch in self._watch:
                watch.close()
            self._watch = []
            self._tokens, self.sim = TokenSet(), None

    def _on_token(self, key: str, alive: bool) -> None:
        token = names.split_token_key(key)
        if token is not None:
            with self._node.changed:
                self._tokens.take(*token, alive)
                self._node.changed.notify_all()
            self._on_news()

    def alive(self, name: str) -> bool:
        """Whether a process holds this name."""
        return name in self._tokens

    def robots(self) -> set[int]:
        """The robots that have a process."""
        with self._node.changed:
            return {i for i in map(names.robot_id_of, self._tokens) if i is not None}

    def ask(self, *, obstacles: bool) -> None:
        """Ask the simulator, if there is one."""
        sim = self._ask(names.service_key(names.SIMULATOR, "status"), SimStatus) if self._has_simulator else None
        self.sim, self.sim_time = sim, monotonic()
        if sim is None:
            self.shapes = self.obstacles = self._shapes_of = None
        elif (version := (sim.instance, sim.robots)) != self._shapes_of:
            self.shapes = self._ask(names.service_key(names.SIMULATOR, "shapes"), ShapesReply)
            self._shapes_of = version if self.shapes is not None else None
        if sim is not None and obstacles and self._obstacles_move:
            self.obstacles = self._ask(names.service_key(names.SIMULATOR, "obstacles"), ObstaclesReply)
        self._on_news()

    @property
    def _has_simulator(self) -> bool:
        return self.alive(names.SIMULATOR)

    @property
    def _obstacles_move(self) -> bool:
        return self.obstacles is None or any(obstacle.movable for obstacle in self.obstacles.obstacles)

    def _ask(self, key: str, kind: type[T]) -> T | None:
        return ask(self._bus, key, kind)


def ask(bus: Bus, key: str, kind: type[T]) -> T | None:
    """The first answer to a query; None if there is none in time."""
    try:
        answers = bus.query(key, kind, timeout=PATIENCE)
    except BusError as error:
        log.debug("%s: %s", key, error)
        return None
    return answers[0][1] if answers else None
