"""Where pages and bus meet: what the pages look at, what has come, and a sign to the pages that there is news."""

import threading
from collections.abc import Callable

from zteam import names
from zteam.geometry import Pose2
from zteam.messages import TFMessage
from zteam.nodes.web.drawables import Drawables
from zteam.nodes.web.facts import PERIOD as ASK_PERIOD
from zteam.nodes.web.facts import Facts
from zteam.nodes.web.history import History
from zteam.nodes.web.interest import NOTHING, Sampled, present_robots, scanned_robots, topics_of
from zteam.nodes.web.newest import Newest
from zteam.nodes.web.places import Places
from zteam.nodes.web.subscriptions import Subscriptions
from zteam.nodes.web.viewer import FAST_PERIOD, PERIOD, Viewer
from zteam.runtime.process_node import ProcessNode

LOOK = 0.2
"""Host seconds between two looks at which robots are in sight."""
FAST = 2.0
"""Simulated seconds a second of the host from which on time runs fast."""
REST = 3600.0
"""Host seconds to wait for a page at a time."""


class Hub:
    """The main thread runs `serve`; the thread of the pages makes frames and tells of viewers."""

    def __init__(self, node: ProcessNode) -> None:
        self.node = node
        self.on_news: Callable[[], None] = lambda: None
        """Called from any thread when something came."""
        self.newest = Newest(self._tell)
        self.history = History(self._tell)
        self.drawables = Drawables()
        self.places = Places(self.newest)
        self.facts = Facts(node, self._tell)
        self.facts.on_transforms = self._take_transforms
        self.viewers: dict[int, Viewer] = {}
        self.lease_of: Callable[[int], int | None] = lambda robot_id: None
        """The viewer that drives a robot."""
        self.poses: dict[int, Pose2] = {}
        """The robots' newest poses in `map`. Replaced as a whole."""
        self._subscriptions = Subscriptions(node.bus, self.newest, self.history)
        self._looks = 0
        self._asks = 0

    def _take_transforms(self, message: TFMessage) -> None:
        if self.newest.get(names.TF) is None:
            self.newest.take(names.TF, message)

    def _tell(self) -> None:
        self.on_news()

    @property
    def period(self) -> float:
        """Host seconds between two frames of one page."""
        return FAST_PERIOD if self._runs_fast else PERIOD

    @property
    def _runs_fast(self) -> bool:
        sim = self.facts.sim
        return sim is not None and sim.real_time_factor > FAST and not (sim.paused or sim.finished)

    def robots(self) -> set[int]:
        """All robots of which anything is known."""
        found = present_robots(key for key, _ in self.newest.items()) | self.facts.robots()
        return found if self.facts.sim is None else found | set(self.facts.sim.robots)

    def add(self, viewer: Viewer) -> None:
        """A page came."""
        with self.node.changed:
            self.viewers = {**self.viewers, viewer.number: viewer}
            self.changed()
            self.ask_soon()

    def remove(self, viewer: Viewer) -> None:
        """A page has gone."""
        with self.node.changed:
            self.viewers = {number: other for number, other in self.viewers.items() if other is not viewer}
            self.changed()

    def changed(self) -> None:
        """Some page looks at something else."""
        with self.node.changed:
            self._looks += 1
            self.node.changed.notify_all()

    def ask_soon(self) -> None:
        """Something may have changed that is asked for."""
        with self.node.changed:
            self._asks += 1
            self.node.changed.notify_all()

    def serve(self) -> None:
        """Subscribe to what the pages look at, until the process is asked to stop."""
        threading.Thread(target=self._ask, name="facts", daemon=True).start()
        while not self.node.stopping:
            self._match()

    def _match(self) -> None:
        looks, viewers = self._looks, self.viewers
        self.facts.watch(bool(viewers))
        self._learn()
        aggregator = self.facts.alive(names.AGGREGATOR)
        sampled = self._choose_sampled(aggregator=aggregator)
        wanted = topics_of(viewers.values(), self.poses, self.drawables, aggregator=aggregator, sampled=sampled)
        self._subscriptions.match(wanted)
        for key, content in self.facts.sample(sampled):
            self.newest.take(key, content)
        if not viewers:
            self.newest.drop(lambda _key: True)
            self.places, self.poses = Places(self.newest), {}
        period = LOOK if sampled is NOTHING else FAST_PERIOD
        self.node.wait(lambda: self._looks != looks, period if viewers else REST)

    def _choose_sampled(self, *, aggregator: bool) -> Sampled:
        """Where time runs fast a page sees one message of many, and each that comes slows the run."""
        sim, viewers = self.facts.sim, self.viewers.values()
        if sim is None or not viewers or not self._runs_fast:
            return NOTHING
        return Sampled(scanned_robots(viewers, self.poses) & set(sim.robots), aggregator)

    def _learn(self) -> None:
        """Find out which keys carry something to draw."""
        self.drawables.take_keys(declaration.key for declaration in self.facts.declarations if declaration.publishes)
        for key in self.drawables.unknown():
            arrival = self.newest.get(key)
            if arrival is not None:
                self.drawables.learn(key, arrival.encoding)

    def _ask(self) -> None:
        while not self.node.stopping:
            self._ask_once()

    def _ask_once(self) -> None:
        viewers, asks = self.viewers, self._asks
        if viewers:
            layers = {layer for viewer in viewers.values() for layer in viewer.look.layers}
            docs = {name for viewer in viewers.values() for name in viewer.look.docs}
            self.facts.ask(layers, docs, self._subscriptions.opened)
        self.node.wait(lambda: self._asks != asks, ASK_PERIOD if viewers else REST)
