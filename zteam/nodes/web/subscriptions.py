"""Subscriptions that follow what the pages look at: while no page is open there is none."""

from collections.abc import Callable, Iterable
from functools import partial
from typing import NamedTuple

from zteam.bus import Bus
from zteam.bus.transport import Closeable, RawSample
from zteam.errors import BusError
from zteam.messages import Message
from zteam.nodes.web.history import History
from zteam.nodes.web.newest import Newest


class Topic(NamedTuple):
    """What is subscribed to."""

    key: str
    """A key expression."""
    kind: type[Message] | None = None
    """None: the samples' encoding tells."""
    latched: bool = False
    every: bool = False
    """Whether each message counts, not only the newest."""


class Subscriptions:
    """One thread makes all calls."""

    def __init__(self, bus: Bus, newest: Newest, history: History) -> None:
        self._bus, self._newest, self._history = bus, newest, history
        self._open: dict[Topic, Closeable | None] = {}
        self.opened = 0
        """How many were opened so far that miss what was sent before."""

    def match(self, wanted: Iterable[Topic]) -> None:
        """Subscribe to these and to nothing else. A key that is no key expression is left out."""
        chosen = set(wanted)
        for topic in [topic for topic in self._open if topic not in chosen]:
            self._close(topic, self._open.pop(topic))
        for topic in chosen:
            if topic not in self._open:
                self.opened += not topic.latched
                try:
                    self._open[topic] = self._subscribe(topic)
                except BusError:
                    self._open[topic] = None

    def _close(self, topic: Topic, handle: Closeable | None) -> None:
        if handle is not None:
            handle.close()
        if topic.every:
            self._history.forget(topic.key)

    def _subscribe(self, topic: Topic) -> Closeable:
        take: Callable[..., None] = partial(self._history.take, topic.key) if topic.every else self._newest.take
        if topic.kind is not None and not topic.latched:
            # As bytes, without time and source: at the rate of lock-step this is most of the cost of a view.
            return self._bus.subscribe_contents(topic.key, topic.kind, take)

        def on_sample(sample: RawSample) -> None:
            take(sample.key, sample.content, sample.encoding)

        return self._bus.subscribe_raw(topic.key, on_sample, latched=topic.latched)
