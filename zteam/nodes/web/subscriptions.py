"""Subscriptions that follow what the pages look at: while no page is open there is none."""

from collections.abc import Callable, Iterable
from typing import NamedTuple

from zteam.bus import Bus
from zteam.bus.transport import Closeable, RawSample
from zteam.messages import Message
from zteam.nodes.web.newest import Newest


class Topic(NamedTuple):
    """What is subscribed to."""

    key: str
    """A key expression."""
    kind: type[Message] | None = None
    """None: the samples' encoding tells."""
    latched: bool = False


class Subscriptions:
    """One thread makes all calls."""

    def __init__(self, bus: Bus, newest: Newest, forget: Callable[[Topic], None] = lambda topic: None) -> None:
        """`forget(topic)` is called when one is closed."""
        self._bus, self._newest, self._forget = bus, newest, forget
        self._open: dict[Topic, Closeable] = {}

    def match(self, wanted: Iterable[Topic]) -> None:
        """Subscribe to these and to nothing else."""
        chosen = set(wanted)
        for topic in [topic for topic in self._open if topic not in chosen]:
            self._open.pop(topic).close()
            self._forget(topic)
        for topic in chosen:
            if topic not in self._open:
                self._open[topic] = self._subscribe(topic)

    def _subscribe(self, topic: Topic) -> Closeable:
        take = self._newest.take
        if topic.kind is not None and not topic.latched:
            # As bytes, without time and source: at the rate of lock-step this is most of the cost of a view.
            return self._bus.subscribe_contents(topic.key, topic.kind, take)

        def on_sample(sample: RawSample) -> None:
            take(sample.key, sample.content, sample.encoding)

        return self._bus.subscribe_raw(topic.key, on_sample, latched=topic.latched)
