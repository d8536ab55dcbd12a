"""Latched subscriptions of one session: one for each key expression serves all its readers.

Zenoh's own, `zenoh.ext.AdvancedSubscriber`, asks a publisher twice for each reader, and stays behind when it is closed
(docs/zenoh-report.md). This one asks once: for all readers that are there when the publisher comes, and for each reader
that comes later.
"""

import threading
from collections import deque
from collections.abc import Callable, Iterable
from functools import partial
from itertools import count, takewhile

from zteam.bus.transport import Closeable, Handle, Held, RawSample, SampleHandler
from zteam.clock import NOT_KNOWN, Sent, monotonic
from zteam.names import split_latched_token

_MAX_WRITERS = 4096
"""Writers can come and go; a reader may get the last message of an older one twice."""
_MOST_OF_KEY = 64
"""Publishers of one key that are asked for their last messages."""

Writer = tuple[str, str, str]
"""Key, session and number of a publisher."""
Done = Callable[[], object]
Ask = Callable[[str, Callable[[RawSample], object], Done], None]
"""`ask(token, receive, done)` asks the publisher with this token, without waiting. It calls `receive(sample)`, and
`done()` when nothing more comes."""
Find = Callable[[str, Callable[[str], object], Done], None]
"""`find(key_expr, found, done)` looks for the latched publishers of a key expression, without waiting. It calls
`found(token)` for each, and `done()` after the last."""


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

    needs_look = False
    """Whether it is declared, and the publishers that were there before it have not been looked for."""

    def __init__(
        self, owner: "LatchedSubscriptions", declare: Callable[["LatchedSubscription"], Closeable], passed_over: str
    ) -> None:
        """The publishers of the session `passed_over` are not asked."""
        self.declared = Held(partial(declare, self))
        self._owner, self._passed_over = owner, passed_over
        self.readers: list[_Reader] = []
        self.tokens: dict[Writer, str] = {}

    def receive(self, sample: RawSample, writer: Writer) -> None:
        for reader in list(self.readers):
            reader.receive(sample, writer)

    def on_token(self, token: str, alive: bool) -> None:
        """A latched publisher came or went."""
        writer = split_latched_token(token)
        if writer[1] == self._passed_over:
            return
        with self._owner.lock:
            if not alive:
                self.tokens.pop(writer, None)
                return
            # Any program may hold tokens.
            of_key = sum(key == writer[0] for key, *_ in self.tokens)
            if writer in self.tokens or of_key >= _MOST_OF_KEY or len(self.tokens) >= _MAX_WRITERS:
                return
            self.tokens[writer] = token
            readers = list(self.readers)
            done = self._owner.begin()
        self.ask(writer, token, readers, done)

    def ask(self, writer: Writer, token: str, readers: Iterable[_Reader], done: Done) -> None:
        """Ask a publisher for its last message, for these readers."""

        def answer(sample: RawSample) -> None:
            # Others may answer as well.
            if sample.key == writer[0]:
                for reader in readers:
                    reader.receive(sample, writer)

        self._owner.ask(token, answer, done)


class LatchedSubscriptions:
    """All those of a session."""

    def __init__(
        self, instance: str, declare: Callable[[str, bool, LatchedSubscription], Closeable], find: Find, ask: Ask
    ) -> None:
        """`instance` is the session's id; `declare(key_expr, from_others, subscription)` opens one on it."""
        self._instance, self._declare, self._find, self.ask = instance, declare, find, ask
        self.lock = threading.Lock()
        """That of readers, tokens and the line."""
        self._line: dict[int, Done | None] = {}
        """Questions that are under way (None), and what is called when those before it are over."""
        self._numbers = count()
        self._open: dict[tuple[str, bool], LatchedSubscription] = {}

    def subscribe(self, key_expr: str, handler: SampleHandler, from_others: bool = False) -> Closeable:
        """Call `handler` with the last message of each publisher that is there, and then with what comes; with
        `from_others`, not of this session."""
        reader, place = _Reader(handler), (key_expr, from_others)
        handle = Handle(reader.close, partial(self._leave, place, reader))
        with self.lock:
            subscription = self._open.get(place)
            is_new = subscription is None
            if subscription is None:
                passed_over = self._instance if from_others else ""
                subscription = LatchedSubscription(self, partial(self._declare, *place), passed_over)
                self._open[place] = subscription
            subscription.readers.append(reader)
            there = [(*each, self.begin()) for each in subscription.tokens.items()]
        if is_new:
            try:
                subscription.declared.open()
            except BaseException:
                handle.close()
                raise
            subscription.needs_look = True
        for writer, token, done in there:
            subscription.ask(writer, token, [reader], done)
        return handle

    def when_caught_up(self, call: Done, *, is_known: bool = False) -> None:
        """Call it once the publishers that are there have answered. Those that come later are not waited for: there may
        always be one more. `is_known`: what was looked for so far has answered."""
        with self.lock:
            new = [(key_expr, each) for (key_expr, _), each in self._open.items() if each.needs_look]
            looks = [(*each, self.begin()) for each in new]
            for _, subscription in new:
                subscription.needs_look = False
        for key_expr, subscription, done in looks:
            self._find(key_expr, partial(subscription.on_token, alive=True), done)
        if is_known and not new:
            call()
            return
        with self.lock:
            done = self.begin()
            self._line[next(self._numbers)] = partial(self.when_caught_up, call, is_known=not new)
        done()

    def begin(self) -> Done:
        """A question is asked; what it calls at its end. To be called under `lock`."""
        number = next(self._numbers)
        self._line[number] = None
        return partial(self._end, number)

    def _end(self, number: int) -> None:
        with self.lock:
            del self._line[number]
            ready = list(takewhile(lambda each: each[1] is not None, self._line.items()))
            for number, _ in ready:
                del self._line[number]
        for _, call in ready:
            assert call is not None
            call()

    def _leave(self, place: tuple[str, bool], reader: _Reader) -> None:
        with self.lock:
            subscription = self._open[place]
            subscription.readers.remove(reader)
            if subscription.readers:
                return
            del self._open[place]
        subscription.declared.close()
