"""Latched subscriptions of one session: one for each key expression serves all its readers.

Zenoh's own, `zenoh.ext.AdvancedSubscriber`, asks a publisher twice for each reader, and stays behind when it is closed
(docs/zenoh-report.md). This one asks once: for all readers that are there when the publisher comes, and for each reader
that comes later.
"""

import threading
from collections import deque
from collections.abc import Callable, Iterable
from functools import partial

from zteam.bus.transport import Closeable, Handle, Held, RawSample, SampleHandler
from zteam.clock import NOT_KNOWN, Sent, monotonic
from zteam.names import split_latched_token

_MAX_WRITERS = 4096
"""Writers can come and go; a reader may get the last message of an older one twice."""
_MOST_OF_KEY = 64
"""Publishers of one key that are asked for their last messages."""

Writer = tuple[str, str, str]
"""Key, session and number of a publisher."""
Ask = Callable[[str, Callable[[RawSample], object]], None]
"""`ask(token, receive)` asks the publisher with this token, without waiting, and calls `receive(sample)`."""


class _Reader:
    """Passes samples to one handler, one at a time; drops repeated and older samples of a writer."""

    def __init__(self, handler: SampleHandler) -> None:
        self._handler = handler
        self._lock = threading.Lock()
        self._newest: dict[Writer, Sent] = {}
        self._waiting = deque[RawSample]()
        self._works = self._closed = False

    def receive(self, sample: RawSample, writer: Writer) -> None:
        """Handle a sample, or leave it to the thread that handles one just now."""
        with self._lock:
            newest, sent = self._newest.get(writer, NOT_KNOWN), sample.sent(monotonic())
            # It comes again, or an older one comes late.
            if 0 < sent.stamp == newest.stamp or newest.hides(sent):
                return
            self._newest[writer] = sent
            if len(self._newest) > _MAX_WRITERS:
                del self._newest[next(iter(self._newest))]
            self._waiting.append(sample)
            if self._works:
                return
            self._works = True
        try:
            while True:
                with self._lock:
                    if self._closed or not self._waiting:
                        self._works = False
                        return
                    sample = self._waiting.popleft()
                # Without the lock: handlers take locks of their own.
                self._handler(sample)
        except BaseException:
            # Such as an interrupt of the thread that publishes.
            self._works = False
            raise

    def close(self) -> None:
        with self._lock:
            self._closed = True


class LatchedSubscription:
    """The readers of one key expression, and the latched publishers that are there."""

    def __init__(self, declare: Callable[["LatchedSubscription"], Closeable], ask: Ask, lock: threading.Lock) -> None:
        """`lock` is that of readers and tokens."""
        self.declared = Held(partial(declare, self))
        self._ask, self._lock = ask, lock
        self.readers: list[_Reader] = []
        self.tokens: dict[Writer, str] = {}

    def receive(self, sample: RawSample, writer: Writer) -> None:
        for reader in list(self.readers):
            reader.receive(sample, writer)

    def on_token(self, token: str, alive: bool) -> None:
        """A latched publisher came or went."""
        writer = split_latched_token(token)
        with self._lock:
            if not alive:
                self.tokens.pop(writer, None)
                return
            # Any program may hold tokens.
            of_key = sum(key == writer[0] for key, *_ in self.tokens)
            if writer in self.tokens or of_key >= _MOST_OF_KEY or len(self.tokens) >= _MAX_WRITERS:
                return
            self.tokens[writer] = token
            readers = list(self.readers)
        self.ask(writer, token, readers)

    def ask(self, writer: Writer, token: str, readers: Iterable[_Reader]) -> None:
        """Ask a publisher for its last message, for these readers."""

        def answer(sample: RawSample) -> None:
            # Others may answer as well.
            if sample.key == writer[0]:
                for reader in readers:
                    reader.receive(sample, writer)

        self._ask(token, answer)


class LatchedSubscriptions:
    """All those of a session."""

    def __init__(self, declare: Callable[[str, bool, LatchedSubscription], Closeable], ask: Ask) -> None:
        """`declare(key_expr, from_others, subscription)` opens one on the session."""
        self._declare, self._ask = declare, ask
        self._lock = threading.Lock()
        self._open: dict[tuple[str, bool], LatchedSubscription] = {}

    def subscribe(self, key_expr: str, handler: SampleHandler, from_others: bool = False) -> Closeable:
        """Call `handler` with the last message of each publisher that is there, and then with what comes; with
        `from_others`, not of this session."""
        reader, place = _Reader(handler), (key_expr, from_others)
        handle = Handle(reader.close, partial(self._leave, place, reader))
        with self._lock:
            subscription = self._open.get(place)
            is_new = subscription is None
            if subscription is None:
                subscription = LatchedSubscription(partial(self._declare, *place), self._ask, self._lock)
                self._open[place] = subscription
            subscription.readers.append(reader)
            there = list(subscription.tokens.items())
        if is_new:
            try:
                subscription.declared.open()
            except BaseException:
                handle.close()
                raise
        for writer, token in there:
            subscription.ask(writer, token, [reader])
        return handle

    def _leave(self, place: tuple[str, bool], reader: _Reader) -> None:
        with self._lock:
            subscription = self._open[place]
            subscription.readers.remove(reader)
            if subscription.readers:
                return
            del self._open[place]
        subscription.declared.close()
