"""Publishers of the bus in memory, and what they deliver to.

Between a publisher and a subscriber little is done for each message: what is the same for all of them is done when the
subscribers change (`DirectHandler.bind`).
"""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from zteam.bus.transport import DirectHandler, MessageHandler, RawSample, SampleHandler
from zteam.errors import DecodeError
from zteam.messages import Message, encode
from zteam.messages.sharing import adopt, share

if TYPE_CHECKING:
    from zteam.bus.memory import MemoryHub


class Receiver(NamedTuple):
    """What a hub delivers to."""

    owner: str
    """Of the session, as the session was told."""
    take: Callable[[Any], object]


Deliver = Callable[[Sequence[Receiver], Any], None]


def deliver_now(receivers: Sequence[Receiver], news: Any) -> None:
    """Call every receiver in this thread."""
    for _, take in receivers:
        take(news)


class Subscriber(NamedTuple):
    """A subscription of some session."""

    session: str
    owner: str
    key_expr: str
    handler: SampleHandler


class _Matching(NamedTuple):
    """The receivers of one publisher."""

    version: int
    """Of the hub's subscribers, when they were looked for."""
    direct: list[Receiver]
    """Take messages."""
    others: list[Receiver]
    """Take samples of the messages too."""
    all: list[Receiver]
    """Take samples."""


class MemoryPublisher:
    """Puts payloads on one key of a hub."""

    def __init__(
        self,
        hub: "MemoryHub",
        session: str,
        key: str,
        encoding: str,
        latched: bool,
        to_others: bool,
        source: str,
        forget: Callable[["MemoryPublisher"], object],
    ) -> None:
        """`source` is the session id that its samples carry, if it is not `session`. `forget` is called at its end."""
        self._hub = hub
        self._forget = forget
        self._number = hub.new_id()
        self._source = source or session
        self._key = key
        self._encoding = encoding
        self._latched = latched
        self._passed_over = session if to_others else None
        self._closed = False
        self._matching = self._match()

    @property
    def has_subscribers(self) -> bool:
        matching = self._matching
        if matching.version != self._hub.version:
            matching = self._match()
        return (self._latched or bool(matching.all)) and not self._closed

    def find_subscribers(self) -> bool:
        return self.has_subscribers

    def _match(self) -> _Matching:
        """Look for the subscribers: there may be other ones than before."""
        found, version = self._hub.matching(self._key, self._passed_over)
        bound = [self._bind(subscriber.handler) for subscriber in found]
        every = [Receiver(subscriber.owner, subscriber.handler) for subscriber in found]
        direct = [Receiver(every[i].owner, take) for i, take in enumerate(bound) if take is not None]
        others = [every[i] for i, take in enumerate(bound) if take is None]
        # At once: another thread may look in between.
        self._matching = _Matching(version, direct, others, every)
        return self._matching

    def _bind(self, handler: SampleHandler) -> MessageHandler | None:
        # A latched message is kept as a sample, and has a time.
        if self._latched or not isinstance(handler, DirectHandler):
            return None
        return handler.bind(self._key, self._encoding, self._source)

    def put(self, payload: bytes) -> None:
        self._send_sample(bytes(payload))

    def put_message(self, message: Message) -> None:
        try:
            shared = share(message)
        except DecodeError:
            # The receivers are to refuse it, each with its reason.
            self._send_sample(encode(message))
        else:
            self._send(shared)

    def hand_over(self, message: Message) -> None:
        self._send(adopt(message))

    def _send(self, message: Message) -> None:
        if self._latched:
            self._send_sample(message)
            return
        hub, matching = self._hub, self._matching
        if matching.version != hub.version:
            matching = self._match()
        if self._closed:
            return
        if matching.direct:
            hub.deliver(matching.direct, message)
        if matching.others:
            hub.deliver(matching.others, self._sample(message))

    def _sample(self, content: bytes | Message) -> RawSample:
        return RawSample(self._key, content, self._encoding, next(self._hub.timestamps), self._source)

    def _send_sample(self, content: bytes | Message) -> None:
        hub = self._hub
        with hub.lock:
            if self._closed:
                return
            sample = self._sample(content)
            if self._latched:
                hub.latched[self._number] = sample
            matching = self._matching if self._matching.version == hub.version else self._match()
        hub.deliver(matching.all, sample)

    def close(self) -> None:
        with self._hub.lock:
            self._closed = True
            self._hub.latched.pop(self._number, None)
        self._forget(self)
