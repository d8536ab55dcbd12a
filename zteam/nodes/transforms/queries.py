"""The aggregator's answers to queries about its tree."""

from collections.abc import Callable

import msgspec

from zteam import names
from zteam.bus import Bus, Deferred, NoRequest
from zteam.clock import monotonic
from zteam.errors import UsageError
from zteam.messages import TFMessage, TransformStamped, encode, ns_from_time
from zteam.names import strip_slash
from zteam.services.transforms import (
    MAX_LOOKUPS,
    BundleReply,
    HistoryReply,
    HistoryRequest,
    Lookup,
    LookupReply,
    LookupRequest,
)
from zteam.tf import Buffer, FrameInfo, TransformException
from zteam.tf.do_transform import floats_of
from zteam.tf.merge import Merger


def serve_queries(
    bus: Bus, merger: Merger, newest: Callable[[], TFMessage], name_of: Callable[[str], str | None]
) -> None:
    """Answer `tf/lookup`, `tf/history`, `tf/conflicts` and `tf/frames` from this tree, `tf/newest` from the bus.

    `name_of` as in StaticTransforms.
    """
    serve, service, buffer = bus.serve, names.service_key, merger.buffer
    serve(service(names.AGGREGATOR, "lookup"), LookupRequest, lambda request: answer_lookups(buffer, request))
    serve(service(names.AGGREGATOR, "history"), HistoryRequest, lambda request: answer_history(buffer, request))
    serve(service(names.AGGREGATOR, "conflicts"), NoRequest, lambda _: merger.conflicts())
    serve(service(names.AGGREGATOR, "frames"), NoRequest, lambda _: answer_frames(buffer, name_of))
    serve(service(names.AGGREGATOR, "newest"), NoRequest, lambda _: BundleReply(encode(newest())))


def answer_lookups(buffer: Buffer, request: LookupRequest) -> list[LookupReply] | Deferred:
    """Replies in the order of the look-ups; deferred if the request has a timeout and data is missing."""
    replies = [_try(buffer, lookup) for lookup in request.lookups]
    if request.timeout <= 0.0 or not any(reply.error for reply in replies):
        return replies
    return Deferred(lambda: _wait_for_all(buffer, request, replies))


def _try(buffer: Buffer, lookup: Lookup) -> LookupReply:
    try:
        return _reply_of(_look_up(buffer, lookup))
    except TransformException as error:
        return LookupReply(error=type(error).__name__, text=str(error))


def _look_up(buffer: Buffer, lookup: Lookup) -> TransformStamped:
    target, source, fixed = strip_slash(lookup.target), strip_slash(lookup.source), strip_slash(lookup.fixed)
    if fixed:
        return buffer.lookup_transform_full(target, lookup.time, source, lookup.source_time, fixed)
    return buffer.lookup_transform(target, source, lookup.time)


def _reply_of(found: TransformStamped) -> LookupReply:
    x, y, z, i, j, k, w = floats_of(found.transform)
    return LookupReply(ns_from_time(found.header.stamp), (x, y, z), (i, j, k, w))


def _wait_for_all(buffer: Buffer, request: LookupRequest, replies: list[LookupReply]) -> list[LookupReply]:
    end = monotonic() + request.timeout
    for i, lookup in enumerate(request.lookups):
        if replies[i].error:
            _wait_for(buffer, lookup, end)
            replies[i] = _try(buffer, lookup)
    return replies


def _wait_for(buffer: Buffer, lookup: Lookup, end: float) -> None:
    """Wait until a look-up has an answer, or until host time `end`."""
    target, source, fixed = strip_slash(lookup.target), strip_slash(lookup.source), strip_slash(lookup.fixed)
    legs = [(fixed, source, lookup.source_time), (target, fixed, lookup.time)]
    for leg in legs if fixed else [(target, source, lookup.time)]:
        try:
            buffer.wait_for_transform(*leg, max(0.0, end - monotonic()))
        except TransformException:
            return


def answer_history(buffer: Buffer, request: HistoryRequest) -> HistoryReply:
    """`target_from_source` over a span of time. Raises UsageError for more than MAX_LOOKUPS rows."""
    target, source = strip_slash(request.target), strip_slash(request.source)
    newest = buffer.lookup_transform(target, source, 0)
    end = request.end or ns_from_time(newest.header.stamp)
    start = request.start if request.start > 0 else end + request.start
    if (end - start) // request.step >= MAX_LOOKUPS:
        raise UsageError(f"more than {MAX_LOOKUPS} rows: take a larger step or a shorter span")
    rows = []
    for time in range(start, end + 1, request.step):
        reply = _try(buffer, Lookup(target, source, time)) if time > 0 else LookupReply(error="before time")
        if not reply.error:
            rows.append((reply.stamp, *reply.translation, *reply.rotation))
    return HistoryReply(rows)


def answer_frames(buffer: Buffer, name_of: Callable[[str], str | None]) -> dict[str, FrameInfo]:
    """Every child frame, by name, with its authority as users read it."""
    return {
        child: msgspec.structs.replace(info, authority=name_of(info.authority) or info.authority)
        for child, info in buffer.frames().items()
    }
