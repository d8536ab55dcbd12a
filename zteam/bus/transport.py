"""What the typed bus needs of whatever carries its messages: Zenoh, or the memory of one process."""

import logging
import re
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, Protocol, TypeVar

import msgspec
import zenoh

from zteam.clock import Sent
from zteam.errors import BusError, DecodeError, KeyExpressionError, ZteamError

if TYPE_CHECKING:
    # The router needs neither messages nor numpy, and starts twice as fast without them.
    from zteam.messages import Message

T = TypeVar("T")
log = logging.getLogger("zteam.bus")

MAX_PAYLOAD = 64 * 1024 * 1024
"""Bytes of a message, a request or an answer; a map of 4000 x 4000 cells has 16 MB. Larger ones are not decoded."""
MAX_DEFERRED = 64
"""Answers of a session that take their time at once; each has a thread."""
_LAST_CALL = 0.3
"""Host seconds that the end of a session waits for what a thread has begun."""


def size_problem(payload: bytes) -> str:
    """Why a payload is too large to be decoded; empty if it is not."""
    return f"its {len(payload)} bytes are more than {MAX_PAYLOAD}" if len(payload) > MAX_PAYLOAD else ""


_DECODERS: dict[Any, msgspec.json.Decoder[Any]] = {}
"""By type. msgspec 0.22 crashes if two threads use a type for the first time at once, so they are made under a lock."""
_MAKING = threading.Lock()


def decode_json(payload: bytes, kind: type[T]) -> T:
    """A request or an answer. Raises DecodeError."""
    if problem := size_problem(payload):
        raise DecodeError(problem)
    with _MAKING:
        if kind not in _DECODERS:
            _DECODERS[kind] = msgspec.json.Decoder(kind)
    try:
        decoded: T = _DECODERS[kind].decode(payload)
        return decoded
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise DecodeError(str(error)) from None
    except RecursionError:
        raise DecodeError("it is nested too deeply") from None


_SOURCE = re.compile(r" at \S+\.rs:\d+\.?")
_SYNTAX = re.compile(r"--> (?P<line>\d+):(?P<column>\d+) .* = (?P<text>.*)")
_MESSAGE = re.compile(
    r"\b(?:msg: |message: |problem: |Error\()(?P<text>\"(?:[^\"\\]|\\.)*\")"
    r"(?:.*?line: (?P<line>\d+), column: (?P<column>\d+))?"
)


def zenoh_text(error: zenoh.ZError) -> str:
    """What an error of Zenoh says, on one line: with its place in a file that was read, without Zenoh's source."""
    text = " ".join(_SOURCE.sub("", str(error)).split())
    found = _SYNTAX.search(text) or _MESSAGE.search(text)
    if found is None:
        return text
    told = found["text"].strip('"').replace('\\"', '"')
    return f"line {found['line']}, column {found['column']}: {told}" if found["line"] else told


def problem_of(key: str) -> str:
    """What is wrong with a key expression, and the one that is meant; empty if nothing is wrong."""
    problem = "spaces at its ends would be a part of it" if key != key.strip() else ""
    try:
        zenoh.KeyExpr(key)
    except zenoh.ZError as error:
        problem = problem or zenoh_text(error)
    if not problem:
        return ""
    # Users of ROS begin a topic with a slash; a wildcard within a part is $*.
    parts = [re.sub(r"(\$?\*)+", "$*", each) if each.strip("*") else each for each in map(str.strip, key.split("/"))]
    try:
        meant = zenoh.KeyExpr.autocanonize("/".join("*" if each == "$*" else each for each in parts if each))
        hint = f": write {str(meant)!r}"
    except zenoh.ZError:
        hint = ""
    return f"{key!r} is not a key expression ({problem.partition(': ')[2] or problem}){hint}"


_parse_key = lru_cache(4096)(zenoh.KeyExpr)
"""To parse it takes much longer than to compare two of them."""


def matches(key_expr: str, other: str) -> bool:
    """Whether some key is in both key expressions."""
    return bool(_parse_key(key_expr).intersects(_parse_key(other)))


def check_use(action: str, key: str, closed: bool) -> None:
    """Raise BusError if the session is closed or `key` is no key expression; `action` is a verb, such as "ask"."""
    if closed:
        raise BusError(f"cannot {action} {key}: the session is closed")
    if not isinstance(key, str):
        raise KeyExpressionError(f"{key!r:.60} is no text: give a key such as 'robot_0/odom'")
    if problem := problem_of(key):
        raise KeyExpressionError(problem)


def call(handler: Callable[..., object], *event: object) -> None:
    """Call a handler of something other than messages; its error is logged."""
    try:
        handler(*event)
    except Exception:
        # It must not end the calls that follow, nor be that of a session that has sent the event.
        log.exception("error in a callback of the bus")


def let_end(thread: threading.Thread | None) -> None:
    """Wait a moment for a thread that may be in a call of Zenoh.

    At the interpreter's end Python ends a thread where it comes back from a call. If that is one of Zenoh, such as a
    query, the process aborts ("FATAL: exception not rethrown").
    """
    if thread is not None and thread is not threading.current_thread():
        thread.join(_LAST_CALL)


class RawSample(msgspec.Struct, eq=False, gc=False):
    """One message as it came."""

    key: str
    content: "bytes | Message"
    """Its bytes; within one process the message itself, which is not to be changed."""
    encoding: str
    """`application/cdr;sensor_msgs/msg/LaserScan`; empty where the sender named none."""
    timestamp: int = 0
    """NTP64 time from the session that stamped it first, normally the sender's; 0 where there is none."""
    source: str = ""
    """Id of the session that stamped it; empty where there is none. Where another router than zteam's
    makes stamps, a sender that makes none shows as the router."""
    delay: float = 0.0
    """Host seconds from its stamp to its arrival, by two hosts' clocks; 0 where there is no stamp, and in memory."""

    def apart(self) -> "RawSample":
        """The same, to be kept: one of Zenoh's holds the whole buffer that it came in."""
        return RawSample(self.key, self.content, self.encoding, self.timestamp, self.source, self.delay)

    def sent(self, now: float) -> Sent:
        """When it was sent; it comes at host time `now`."""
        return Sent(self.timestamp, self.delay, now)

    @property
    def payload(self) -> bytes:
        """Its bytes, which are made now if it has none."""
        if isinstance(self.content, bytes):
            return self.content
        from zteam.messages import encode

        return encode(self.content)


class Reply(NamedTuple):
    """One answer to a query; `error` tells that `payload` is the error's text."""

    key: str
    payload: bytes
    error: bool


TIMED_OUT = Reply("", b"no answer in time", True)
"""This very reply, and no other one of its text, stands for answers that did not come in time."""


class Declaration(NamedTuple):
    """A publisher or a subscriber of some session."""

    key: str
    """A key expression."""
    session: str
    publishes: bool
    dropped: bool = False
    """Whether the router's access control drops what it publishes, as far as is known."""


class Closeable(Protocol):
    """A declaration on the bus that can be taken back."""

    def close(self) -> None:
        """Take it back; a second call does nothing."""


C = TypeVar("C", bound=Closeable)


class Handle:
    """A declaration that is taken back by these calls, in order and once."""

    def __init__(self, *calls: Callable[[], object]) -> None:
        self.calls = calls

    def close(self) -> None:
        calls, self.calls = self.calls, ()
        for each in calls:
            each()


H = TypeVar("H", bound=Handle)


class Held(Generic[C]):
    """A declaration that is made by `open`, unless it was closed before."""

    def __init__(self, declare: Callable[[], C]) -> None:
        self._declare = declare
        self._lock = threading.Lock()
        self._handle: C | None = None
        self._closed = False

    def open(self) -> None:
        with self._lock:
            if not self._closed:
                self._handle = self._declare()

    def renew(self) -> None:
        """Declare a query anew that another process, which has ended, answered too; nothing where it is not open.

        Where that one was at another router, Zenoh's routers forget this one when next the link between them is lost.
        """
        with self._lock:
            before = self._handle
            if self._closed or before is None:
                return
            try:
                # First the new one: a query that comes between is answered.
                self._handle = self._declare()
            except BusError as error:
                # The session was closed meanwhile.
                log.debug("%s", error)
                return
            before.close()

    def close(self) -> None:
        with self._lock:
            self._closed = True
            if self._handle is not None:
                self._handle.close()


class RawPublisher(Closeable, Protocol):
    """Publishes on one key."""

    @property
    def has_subscribers(self) -> bool:
        """Whether a message put now has a subscriber; always True for a latched publisher, False once closed."""

    def put(self, content: "bytes | Message") -> None:
        """Send without waiting: what finds no room is dropped. Raises EncodeError.

        A message is the transport's from now on (`Publisher.put_owned`).
        """


SampleHandler = Callable[[RawSample], None]
Finish = Callable[[], bytes]
"""Makes an answer, and may take its time."""
QueryHandler = Callable[[str, bytes], bytes | Finish]
"""Answers a query, of which it gets the key expression that was asked and the payload."""
TokenHandler = Callable[[str, bool], None]


class Answers:
    """The answers of one session to queries."""

    def __init__(self) -> None:
        self._free = threading.BoundedSemaphore(MAX_DEFERRED)

    def answer(self, key: str, make: Callable[[], bytes | Finish], send: Callable[[Reply], object]) -> None:
        """Send what `make()` returns. What takes its time is finished on a new thread, unless too many are at work.

        The text of a ZteamError goes to the asker as it is. Any other exception is a fault: it is logged here, and the
        asker gets its type and text.
        """
        try:
            made = make()
        except ZteamError as error:
            send(error_reply(str(error)))
        except Exception as error:
            log.exception("error while answering the query %s", key)
            send(error_reply(f"{type(error).__name__}: {error}"))
        else:
            if isinstance(made, bytes):
                send(Reply(key, made, False))
            elif self._free.acquire(blocking=False):
                threading.Thread(target=self._finish, args=(key, made, send), name="answer", daemon=True).start()
            else:
                send(error_reply(f"more than {MAX_DEFERRED} queries are waiting: ask again later"))

    def _finish(self, key: str, finish: Finish, send: Callable[[Reply], object]) -> None:
        try:
            self.answer(key, finish, send)
        finally:
            self._free.release()


def error_reply(text: str) -> Reply:
    """A reply that carries an error; as in Zenoh, it has no key."""
    return Reply("", text.encode(), True)


class Transport(ABC):
    """A session, in the words of Zenoh. Handlers are called from the transport's threads and must be quick.

    After `close`, declarations and `get` raise BusError; so does a key that is no key expression.
    """

    def __init__(self, instance: str) -> None:
        self.instance = instance
        """This session's id, unique among all sessions."""
        self.closed = False
        self._open: dict[Handle, None] = {}
        """In the order in which they were declared."""
        self._answers = Answers()

    def _keep(self, handle: H) -> H:
        """A declaration that is closed with the session, if it is not before."""
        self._open[handle] = None
        handle.calls = lambda: self._open.pop(handle, None), *handle.calls
        return handle

    @abstractmethod
    def declare_publisher(
        self, key: str, encoding: str, latched: bool, to_others: bool = False, source: str = ""
    ) -> RawPublisher:
        """A publisher; a latched one keeps its last payload for late subscribers.

        With `to_others` it does not reach subscribers of its own session. `source` is the session id that its samples
        carry, if it is not this session's.
        """

    @abstractmethod
    def declare_subscriber(
        self, key_expr: str, handler: SampleHandler, latched: bool, from_others: bool = False
    ) -> Closeable:
        """A subscriber; a latched one also gets what was put before it came. With `from_others` it gets nothing from
        publishers of its own session.
        """

    @abstractmethod
    def when_caught_up(self, call: Callable[[], object]) -> None:
        """Call it, on any thread, once what was latched before each latched subscriber has come to it. A publisher
        that does not answer is not waited for any longer after a time."""

    @abstractmethod
    def declare_queryable(self, key: str, handler: QueryHandler) -> Closeable:
        """Answer queries on `key`; what `handler` raises goes to the asker as an error text."""

    @abstractmethod
    def get(self, key_expr: str, payload: bytes, timeout: float, to_others: bool = False) -> list[Reply]:
        """Ask and wait for all answers, `timeout` seconds at most; then one of them is TIMED_OUT.

        With `to_others` the own session is not asked.
        """

    @abstractmethod
    def declare_token(self, key: str) -> Closeable:
        """A token that lives as long as this session."""

    @abstractmethod
    def watch_tokens(self, key_expr: str, handler: TokenHandler) -> Closeable:
        """Call `handler(key, alive)` for tokens that are there, come or go."""

    def settle(self) -> None:  # noqa: B027
        """Wait until what has come is handled, where messages wait for a thread. Not for handlers."""

    def watch_link(self, handler: Callable[[bool], None]) -> None:  # noqa: B027
        """Call `handler(up)` when the link to the router is lost or back; without a router it never is."""

    def close(self) -> None:
        """Undeclare everything and end the session; a second call does nothing."""
        self.closed = True
        for declared in list(self._open):
            declared.close()
