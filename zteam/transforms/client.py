"""The aggregator's queries `tf/static`, `tf/lookup`, `tf/history` and `tf/newest`, and a client that looks up.

The answer to `tf/frames` is a `zteam.tf.FrameInfo` for each child frame.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Annotated

import msgspec

from zteam import names
from zteam.bus import Bus, Change
from zteam.errors import BusError, log
from zteam.geometry import Pose2, yaw_from_quaternion
from zteam.messages import Clock, TFMessage, Time, TransformStamped, ns_from_time, time_from_ns
from zteam.transforms import Buffer, FrameInfo, errors
from zteam.transforms.rigid import stamped_transform

MAX_LOOKUPS = 10_000
"""Of one request; rows of one history."""
MAX_WAIT = 60.0
"""Seconds that a look-up may be waited for."""
_GRACE = 2.0
"""Host seconds that an answer may take beyond what it waits for."""
MAX_COORDINATE = 1e9
"""Metres of a fixed transform at most, either way."""
Coordinate = Annotated[float, msgspec.Meta(ge=-MAX_COORDINATE, le=MAX_COORDINATE)]
MAX_TIME = 2**62
"""Nanoseconds, either way."""
Nanoseconds = Annotated[int, msgspec.Meta(ge=-MAX_TIME, le=MAX_TIME)]


class StaticRequest(Change):
    """Hang `child` under `parent` at x, y, z (m) and the quaternion, for as long as the caller's session lives."""

    parent: str
    child: str
    caller: str
    """The caller's session id; its token `static/alive/<caller>` shows that it lives."""
    x: Coordinate = 0.0
    y: Coordinate = 0.0
    z: Coordinate = 0.0
    qx: Coordinate = 0.0
    qy: Coordinate = 0.0
    qz: Coordinate = 0.0
    qw: Coordinate = 1.0

    def transform(self) -> TransformStamped:
        """The transform; names may have a leading slash."""
        floats = (self.x, self.y, self.z, self.qx, self.qy, self.qz, self.qw)
        return stamped_transform(Time(), names.strip_slash(self.parent), names.strip_slash(self.child), floats)


class StaticReply(msgspec.Struct):
    """`refused` says why not; empty if the transform holds."""

    refused: str = ""


class Lookup(msgspec.Struct):
    """The pose of `source` in `target` at `time` (ns; 0 = latest common).

    With `fixed`, a frame that does not move: of `source` as it was at `source_time`, in `target` as it was at `time`.
    """

    target: str
    source: str
    time: Nanoseconds = 0
    fixed: str = ""
    source_time: Nanoseconds = 0

    def __post_init__(self) -> None:
        """Take names with the leading slash that ROS users write."""
        self.target, self.source, self.fixed = map(names.strip_slash, (self.target, self.source, self.fixed))


class LookupRequest(msgspec.Struct):
    """One or many look-ups, answered in this order; those that cannot be yet are waited for, `timeout` s in all."""

    lookups: Annotated[list[Lookup], msgspec.Meta(max_length=MAX_LOOKUPS)]
    timeout: Annotated[float, msgspec.Meta(ge=0.0, le=MAX_WAIT)] = 0.0


class LookupReply(msgspec.Struct):
    """A transform, or the exception's name and text."""

    stamp: int = 0
    translation: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rotation: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)
    error: str = ""
    text: str = ""


class HistoryRequest(msgspec.Struct):
    """The poses of `source` in `target` every `step` ns from `start` to `end` (ns).

    `end` 0 is the latest common time; a `start` of 0 or below is counted from the end.
    """

    target: str
    source: str
    step: Annotated[int, msgspec.Meta(ge=1, le=MAX_TIME)]
    start: Nanoseconds = 0
    end: Nanoseconds = 0


class HistoryReply(msgspec.Struct):
    """Rows of stamp (ns), x, y, z, qx, qy, qz, qw, oldest first; instants without data are left out."""

    rows: list[tuple[int, float, float, float, float, float, float, float]]


class BundleReply(msgspec.Struct):
    """Answer to `tf/newest`: the bundle that was sent last, an encoded TFMessage."""

    content: bytes


class TransformClient:
    """tf2's look-ups, answered by the aggregator's own buffer, for processes that need few transforms.

    Names may have a leading slash.
    """

    def __init__(self, bus: Bus) -> None:
        self._bus = bus

    def lookup_transform(
        self, target_frame: str, source_frame: str, time: int = 0, timeout: float = 0.0
    ) -> TransformStamped:
        """The pose of `source_frame` in `target_frame`; the aggregator waits up to `timeout` s until there is one.

        Raises tf2's exceptions, and BusError if no aggregator answers.
        """
        (found,) = self.lookup_many([Lookup(target_frame, source_frame, time)], timeout)
        if isinstance(found, errors.TransformException):
            raise found
        return found

    def lookup_many(
        self, lookups: Sequence[Lookup], timeout: float = 0.0
    ) -> list[TransformStamped | errors.TransformException]:
        """Many look-ups at once: a transform or an exception for each. Raises BusError if no aggregator answers."""
        key = names.service_key(names.AGGREGATOR, "lookup")
        request = LookupRequest(list(lookups), timeout)
        replies = self._bus.ask(key, list[LookupReply], request, timeout=timeout + _GRACE)
        if len(replies) != len(lookups):
            raise BusError(f"{key}: {len(replies)} answers to {len(lookups)} look-ups")
        return [_result(lookup, reply) for lookup, reply in zip(lookups, replies, strict=True)]

    def find_poses(self, lookups: Mapping[int, Lookup]) -> dict[int, Pose2]:
        """The planar poses that are known, by the same numbers; none if no aggregator answers."""
        try:
            found = self.lookup_many([*lookups.values()]) if lookups else []
        except BusError as error:
            # The session may also be closed.
            log.debug("%s", error)
            return {}
        return {
            number: Pose2(place.x, place.y, yaw_from_quaternion(turn.x, turn.y, turn.z, turn.w))
            for number, each in zip(lookups, found, strict=True)
            if isinstance(each, TransformStamped)
            for place, turn in [(each.transform.translation, each.transform.rotation)]
        }

    def history(self, request: HistoryRequest) -> HistoryReply:
        """One pair of frames over a span of time. Raises BusError if no aggregator answers, or if it refuses."""
        return self._bus.ask(names.service_key(names.AGGREGATOR, "history"), HistoryReply, request)


def _result(lookup: Lookup, reply: LookupReply) -> TransformStamped | errors.TransformException:
    if reply.error:
        # A newer aggregator may know exceptions that this process does not.
        kind = getattr(errors, reply.error, None)
        if not isinstance(kind, type) or not issubclass(kind, errors.TransformException):
            kind = errors.TransformException
        return kind(reply.text)
    floats = (*reply.translation, *reply.rotation)
    return stamped_transform(time_from_ns(reply.stamp), lookup.target, lookup.source, floats)


def find_frames(bus: Bus, timeout: float = 2.0) -> dict[str, FrameInfo] | None:
    """The aggregator's own data on every frame; None without an aggregator."""
    try:
        return bus.ask(names.service_key(names.AGGREGATOR, "frames"), dict[str, FrameInfo], timeout=timeout)
    except BusError:
        return None


class TreeListener:
    """A buffer of a session's own, filled from the aggregator's tree."""

    def __init__(self, bus: Bus, on_news: Callable[[], None] = lambda: None) -> None:
        self.buffer, self.now, self._on_news = Buffer(), 0, on_news
        bus.subscribe(names.CLOCK, Clock, self._on_clock)
        bus.subscribe(names.TF, TFMessage, self._on_tf)
        bus.subscribe(names.TF_STATIC, TFMessage, self._on_tf_static, latched=True)

    def _on_clock(self, _key: str, message: Clock) -> None:
        self.now = ns_from_time(message.clock)
        self.buffer.take_time(self.now)

    def _on_tf(self, _key: str, message: TFMessage) -> None:
        self.buffer.set_transforms(message.transforms, names.TF, self.now)
        self._on_news()

    def _on_tf_static(self, _key: str, message: TFMessage) -> None:
        self.buffer.set_all_static(message.transforms, names.TF)
        self._on_news()
