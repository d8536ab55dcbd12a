"""What happens to a sample that arrives: it is checked, decoded, counted and handled."""

import logging
from collections.abc import Callable
from typing import TypeVar

from zteam.bus.counters import MAX_KEYS, Counters
from zteam.bus.payloads import size_problem
from zteam.bus.transport import RawSample, SampleHandler
from zteam.errors import DecodeError
from zteam.messages import Message, decode, encoding_of
from zteam.names import is_wildcard

log = logging.getLogger("zteam.bus")

M = TypeVar("M", bound=Message)
T = TypeVar("T")

_CDR = "application/cdr"


class Receiver:
    """Makes the transport's handlers of typed callbacks; samples that are refused are counted as dropped."""

    def __init__(self, counters: Counters) -> None:
        self._counters = counters

    def decode(self, sample: RawSample, message_type: type[M]) -> M | None:
        """The sample's message; None if it is refused (the counters say why)."""
        return self._read(sample, message_type, lambda raw: decode(message_type, raw.payload))

    def messages(self, message_type: type[M], callback: Callable[[str, M], None]) -> SampleHandler:
        """Calls `callback(key, message)`."""

        def handle(sample: RawSample) -> None:
            message = self.decode(sample, message_type)
            if message is not None:
                callback(sample.key, message)

        return self.guarded(handle)

    def latched_messages(self, message_type: type[M], callback: Callable[[str, M], None]) -> SampleHandler:
        """Calls `callback(key, message)` unless a newer message of the key was handled before."""
        newest: dict[str, int] = {}

        def handle(sample: RawSample) -> None:
            if 0 < sample.timestamp <= newest.get(sample.key, 0):
                return
            message = self.decode(sample, message_type)
            if message is None:
                return
            if sample.key in newest or len(newest) < MAX_KEYS:
                newest[sample.key] = sample.timestamp
            callback(sample.key, message)

        return self.guarded(handle)

    def payloads(self, message_type: type[Message], callback: Callable[[str, bytes], None]) -> SampleHandler:
        """Calls `callback(key, payload)`, which may raise DecodeError."""

        def take(sample: RawSample) -> None:
            callback(sample.key, sample.payload)

        return self.guarded(lambda sample: self._read(sample, message_type, take))

    def guarded(self, callback: Callable[[RawSample], object]) -> SampleHandler:
        """Calls `callback(sample)` for samples of a permitted size, and logs its exceptions."""

        def handle(sample: RawSample) -> None:
            if problem := size_problem(sample.payload):
                self._counters.drop(sample.key, problem)
                return
            try:
                callback(sample)
            except Exception:
                # A fault in one callback must not end the subscription, and no other code sees it after the bus.
                log.exception("error while handling a message on %s", sample.key)

        return handle

    def _read(self, sample: RawSample, message_type: type[Message], read: Callable[[RawSample], T]) -> T | None:
        expected = encoding_of(message_type)
        if is_wildcard(sample.key):
            self._counters.drop(sample.key, "its key is a wildcard, not the name of one topic")
            return None
        if sample.encoding.startswith(_CDR + ";") and sample.encoding != expected:
            given, due = sample.encoding.removeprefix(_CDR + ";"), message_type.ros_type
            self._counters.drop(sample.key, f"wrong type: it is {given}, {due} is due")
            return None
        try:
            found = read(sample)
        except DecodeError as error:
            self._counters.drop(sample.key, str(error))
            return None
        self._counters.receive(sample.key)
        return found
