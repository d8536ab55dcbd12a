"""Latched subscriptions of one session: one for each key expression serves all its readers.

Zenoh's own, `zenoh.ext.AdvancedSubscriber`, asks a publisher twice for each reader, and stays behind when it is closed
(docs/zenoh-report.md). This one asks once, when the publisher comes, and keeps the answer for later readers until the
publisher goes.
"""

import threading
from collections import deque
from collections.abc import Callable, Iterable
from functools import partial

import msgspec

from zteam.bus.transport import Closeable, Handle, Held, RawSample, SampleHandler
from zteam.clock import NOT_KNOWN, Sent, monotonic
from zteam.names import split_latched_token

KEPT_BYTES = 64 * 1024 * 1024
"""Of the messages that a subscription keeps. Those beyond it are asked for again when a reader comes."""
_MAX_WRITERS = 4096
"""Writers can come and go; a reader may get the last message of an older one twice."""
_MOST_OF_KEY = 64
"""Publishers of one key that are asked for their last messages."""

Writer = tuple[str, str, str]
"""Key, session and number of a publisher."""
Ask = Callable[[str, Callable[[RawSample], object], Callable[[], object]], None]
"""`ask(token, receive, end)` asks the publisher with this token, without waiting: `receive(sample)`, then `end()`."""


class _Reader:
    """Calls one handler on one thread at a time; of a writer, with nothing that comes again, or that the last hides."""

    def __init__(self, handler: SampleHandler, kept: Iterable[tuple[RawSample, Writer]]) -> None:
        """What is `kept` comes first. Nothing is handled before `work`."""
        self._handler = handler
        self._lock = threading.Lock()
        self._newest: dict[Writer, Sent] = {}
        self._waiting = deque[RawSample]()
        self._works, self._closed = True, False
        for sample, writer in kept:
            self._put(sample, writer)

    def _put(self, sample: RawSample, writer: Writer) -> None:
        newest, sent = self._newest.get(writer, NOT_KNOWN), sample.sent(monotonic())
        # It comes again, or an older one comes late.
        if 0 < sent.stamp == newest.stamp or newest.hides(sent):
            return
        self._newest[writer] = sent
        if len(self._newest) > _MAX_WRITERS:
            del self._newest[next(iter(self._newest))]
        self._waiting.append(sample)

    def receive(self, sample: RawSample, writer: Writer) -> None:
        """Handle a sample, or leave it to the thread that handles one just now."""
        with self._lock:
            self._put(sample, writer)
            if self._works:
                return
            self._works = True
        self.work()

    def work(self) -> None:
        """Handle what waits. Without a lock: handlers take locks of their own."""
        try:
            while (sample := self._next()) is not None:
                self._handler(sample)
        except BaseException:
            # Such as an interrupt of the thread that subscribes.
            self._works = False
            raise

    def _next(self) -> RawSample | None:
        with self._lock:
            if self._waiting and not self._closed:
                return self._waiting.popleft()
            self._works = False
            return None

    def close(self) -> None:
        with self._lock:
            self._closed = True


class _Kept(msgspec.Struct):
    """What is known of a publisher that is there."""

    token: str
    sample: RawSample | None = None
    """Its last message, if that is known and there is room."""
    sent: Sent = NOT_KNOWN
    """When that was sent."""
    asked: bool = False
    """Whether its answer may still come."""

    @property
    def size(self) -> int:
        return len(self.sample.payload) if self.sample is not None else 0


class LatchedSubscription:
    """The readers of one key expression, and the last messages of the latched publishers that are there."""

    def __init__(self, declare: Callable[["LatchedSubscription"], Closeable], ask: Ask) -> None:
        self.declared = Held(partial(declare, self))
        self._ask = ask
        self._lock = threading.Lock()
        self._readers: list[_Reader] = []
        self._kept: dict[Writer, _Kept] = {}
        self._bytes = 0

    def join(self, handler: SampleHandler) -> _Reader:
        """A new reader, which begins with what is kept, the oldest first; the caller lets it `work`."""
        with self._lock:
            kept = [(each.sample, writer) for writer, each in self._kept.items() if each.sample is not None]
            reader = _Reader(handler, sorted(kept, key=lambda each: each[0].timestamp))
            self._readers.append(reader)
        return reader

    def complete(self) -> None:
        """Ask again for what is not kept."""
        with self._lock:
            lacking = [writer for writer, each in self._kept.items() if each.sample is None and not each.asked]
        for writer in lacking:
            self._ask_for(writer)

    def leave(self, reader: _Reader) -> bool:
        """Whether it was the last one."""
        with self._lock:
            if reader in self._readers:
                self._readers.remove(reader)
            return not self._readers

    def receive(self, sample: RawSample, writer: Writer) -> None:
        """A message came, or the answer of a publisher."""
        with self._lock:
            each = self._kept.get(writer)
            sent = sample.sent(monotonic())
            if each is not None and (each.sample is None or (sent.stamp and not each.sent.hides(sent))):
                each.sent = sent
                self._keep(each, sample)
            readers = list(self._readers)
        for reader in readers:
            reader.receive(sample, writer)

    def _keep(self, each: _Kept, sample: RawSample | None) -> None:
        self._bytes -= each.size
        each.sample = sample
        self._bytes += each.size
        if self._bytes > KEPT_BYTES:
            self._keep(each, None)

    def on_token(self, token: str, alive: bool) -> None:
        """A latched publisher came or went; what it has published goes with it."""
        writer = split_latched_token(token)
        with self._lock:
            if not alive:
                if (gone := self._kept.pop(writer, None)) is not None:
                    self._keep(gone, None)
                return
            if writer not in self._kept:
                # Any program may hold tokens.
                of_key = sum(key == writer[0] for key, *_ in self._kept)
                if of_key >= _MOST_OF_KEY or len(self._kept) >= _MAX_WRITERS:
                    return
                self._kept[writer] = _Kept(token)
        self._ask_for(writer)

    def _ask_for(self, writer: Writer) -> None:
        with self._lock:
            each = self._kept.get(writer)
            if each is None or each.asked:
                return
            each.asked = True

        def answer(sample: RawSample) -> None:
            # Others may answer as well.
            if sample.key == writer[0]:
                self.receive(sample, writer)

        self._ask(each.token, answer, partial(setattr, each, "asked", False))


class LatchedSubscriptions:
    """All those of a session."""

    def __init__(self, declare: Callable[[str, LatchedSubscription], Closeable], ask: Ask) -> None:
        """`declare(key_expr, subscription)` opens one on the session."""
        self._declare, self._ask = declare, ask
        self._lock = threading.Lock()
        self._open: dict[str, LatchedSubscription] = {}

    def subscribe(self, key_expr: str, handler: SampleHandler) -> Closeable:
        """Call `handler` with what is kept before this returns, and then with what comes."""
        with self._lock:
            is_new = key_expr not in self._open
            if is_new:
                self._open[key_expr] = LatchedSubscription(partial(self._declare, key_expr), self._ask)
            subscription = self._open[key_expr]
            reader = subscription.join(handler)
        handle = Handle(reader.close, partial(self._leave, key_expr, reader))
        if is_new:
            try:
                subscription.declared.open()
            except BaseException:
                handle.close()
                raise
        reader.work()
        subscription.complete()
        return handle

    def _leave(self, key_expr: str, reader: _Reader) -> None:
        with self._lock:
            subscription = self._open[key_expr]
            if not subscription.leave(reader):
                return
            del self._open[key_expr]
        subscription.declared.close()
