"""The aggregator's answers to queries about its tree, without a bus."""

from contextlib import suppress

import msgspec

from zteam import names
from zteam.bus import Deferred
from zteam.clock import monotonic
from zteam.errors import UsageError
from zteam.messages import ns_from_time
from zteam.transforms import Buffer, FrameInfo, TransformException
from zteam.transforms.client import MAX_LOOKUPS, HistoryReply, HistoryRequest, Lookup, LookupReply, LookupRequest
from zteam.transforms.merge import Merger
from zteam.transforms.rigid import floats_of


def answer_lookups(buffer: Buffer, request: LookupRequest) -> list[LookupReply] | Deferred:
    """Replies in the order of the look-ups; deferred if the request has a timeout and data is missing."""
    replies = [_answer(buffer, lookup) for lookup in request.lookups]
    if request.timeout <= 0.0 or not any(reply.error for reply in replies):
        return replies
    return Deferred(lambda: _wait_for_all(buffer, request, replies))


def _answer(buffer: Buffer, lookup: Lookup) -> LookupReply:
    target, source, fixed = lookup.target, lookup.source, lookup.fixed
    try:
        if fixed:
            found = buffer.lookup_transform_full(target, lookup.time, source, lookup.source_time, fixed)
        else:
            found = buffer.lookup_transform(target, source, lookup.time)
    except TransformException as error:
        return LookupReply(error=type(error).__name__, text=str(error))
    x, y, z, i, j, k, w = floats_of(found.transform)
    return LookupReply(ns_from_time(found.header.stamp), (x, y, z), (i, j, k, w))


def _wait_for_all(buffer: Buffer, request: LookupRequest, replies: list[LookupReply]) -> list[LookupReply]:
    """The `replies`, with those that are errors after a wait of `request.timeout` host seconds in all."""
    end = monotonic() + request.timeout
    for i, lookup in enumerate(request.lookups):
        if replies[i].error:
            legs = [(lookup.target, lookup.source, lookup.time)]
            if lookup.fixed:
                legs = [(lookup.fixed, lookup.source, lookup.source_time), (lookup.target, lookup.fixed, lookup.time)]
            with suppress(TransformException):
                for leg in legs:
                    buffer.wait_for_transform(*leg, max(0.0, end - monotonic()))
            replies[i] = _answer(buffer, lookup)
    return replies


def answer_history(buffer: Buffer, request: HistoryRequest) -> HistoryReply:
    """`target_from_source` over a span of time. Raises UsageError for more than MAX_LOOKUPS rows."""
    target, source = names.strip_slash(request.target), names.strip_slash(request.source)
    newest = buffer.lookup_transform(target, source, 0)
    end = request.end or ns_from_time(newest.header.stamp)
    start = request.start if request.start > 0 else end + request.start
    if (end - start) // request.step >= MAX_LOOKUPS:
        raise UsageError(f"more than {MAX_LOOKUPS} rows: take a larger step or a shorter span")
    rows = []
    for time in range(start, end + 1, request.step):
        # 0 and below are no times.
        if time > 0:
            with suppress(TransformException):
                found = buffer.lookup_transform(target, source, time)
                rows.append((ns_from_time(found.header.stamp), *floats_of(found.transform)))
    return HistoryReply(rows)


def answer_frames(merger: Merger) -> dict[str, FrameInfo]:
    """Every child frame, by name, with its authority as users read it."""
    return {
        child: msgspec.structs.replace(info, authority=merger.statics.shown(info.authority))
        for child, info in merger.buffer.frames().items()
    }
