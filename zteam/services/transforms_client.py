"""Look-ups asked of the aggregator, for processes that need few transforms and do not subscribe to all of them."""

from collections.abc import Sequence

from zteam import names
from zteam.bus import Bus
from zteam.messages import Header, Quaternion, Transform, TransformStamped, Vector3, time_from_ns
from zteam.services.transforms import HistoryReply, HistoryRequest, Lookup, LookupReply, LookupRequest
from zteam.tf import errors

_GRACE = 2.0
"""Host seconds that an answer may take beyond what it waits for."""


class TransformClient:
    """tf2's look-ups, answered by the aggregator's own buffer. Names may have a leading slash."""

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
        return [_result(lookup, reply) for lookup, reply in zip(lookups, replies, strict=True)]

    def history(self, request: HistoryRequest) -> HistoryReply:
        """One pair of frames over a span of time. Raises BusError if no aggregator answers, or if it refuses."""
        return self._bus.ask(names.service_key(names.AGGREGATOR, "history"), HistoryReply, request)


def _result(lookup: Lookup, reply: LookupReply) -> TransformStamped | errors.TransformException:
    if reply.error:
        # A newer aggregator may know exceptions that this process does not.
        kind = getattr(errors, reply.error, errors.TransformException)
        return kind(reply.text)
    header = Header(time_from_ns(reply.stamp), names.strip_slash(lookup.target))
    transform = Transform(Vector3(*reply.translation), Quaternion(*reply.rotation))
    return TransformStamped(header, names.strip_slash(lookup.source), transform)
