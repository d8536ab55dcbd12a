"""What happens to a sample that arrives: it is checked, decoded, counted and handled."""

import logging
from collections.abc import Callable
from typing import TypeVar

from zteam.bus.counters import MAX_KEYS, Counters
from zteam.bus.payloads import size_problem
from zteam.bus.transport import DirectHandler, MessageHandler, RawSample, SampleHandler
from zteam.errors import DecodeError
from zteam.messages import Message, decode, encoding_of
from zteam.names import is_wildcard

log = logging.getLogger("zteam.bus")

M = TypeVar("M", bound=Message)

_CDR = "application/cdr;"
_FAULT = "error while handling a message on %s"


class Receiver:
    """Makes the transport's handlers of typed callbacks; samples that are refused are counted as dropped."""

    def __init__(self, counters: Counters) -> None:
        self._counters = counters

    def decode(self, sample: RawSample, message_type: type[M]) -> M | None:
        """The sample's message; None if it is refused (the counters say why)."""
        if self._refuse(sample, message_type):
            return None
        message = sample.content
        if not isinstance(message, message_type):
            try:
                message = decode(message_type, sample.payload)
            except DecodeError as error:
                self._counters.drop(sample.key, str(error))
                return None
        self._counters.receive(sample.key)
        return message

    def messages(self, message_type: type[M], callback: Callable[[str, M], None]) -> SampleHandler:
        """Calls `callback(key, message)`."""

        def handle(sample: RawSample) -> None:
            message = self.decode(sample, message_type)
            if message is not None:
                callback(sample.key, message)

        return self._direct(message_type, handle, callback)

    def messages_from(self, message_type: type[M], callback: Callable[[str, M, str], None]) -> SampleHandler:
        """Calls `callback(key, message, source)`."""

        def handle(sample: RawSample) -> None:
            message = self.decode(sample, message_type)
            if message is not None:
                callback(sample.key, message, sample.source)

        return self._direct(message_type, handle, callback, with_source=True)

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

    def contents(self, message_type: type[M], callback: Callable[[str, bytes | M], None]) -> SampleHandler:
        """Calls `callback(key, content)`, which may raise DecodeError."""

        def handle(sample: RawSample) -> None:
            if self._refuse(sample, message_type):
                return
            content = sample.content
            try:
                callback(sample.key, content if isinstance(content, message_type) else sample.payload)
            except DecodeError as error:
                self._counters.drop(sample.key, str(error))
                return
            self._counters.receive(sample.key)

        return self._direct(message_type, handle, callback)

    def _direct(
        self,
        message_type: type[M],
        handle: SampleHandler,
        callback: Callable[..., None],
        *,
        with_source: bool = False,
    ) -> DirectHandler:
        """A handler of samples that hands the messages of a bound publisher to `callback(key, message[, source])`."""
        guarded = self.guarded(handle)

        def bind(key: str, encoding: str, source: str) -> MessageHandler | None:
            if is_wildcard(key) or encoding != encoding_of(message_type):
                # Each sample is refused and counted.
                return None
            count = self._counters.count_of(key)

            def take(message: Message) -> None:
                if type(message) is not message_type:
                    # Of a class that was defined anew since: the bytes count.
                    guarded(RawSample(key, message, encoding, 0, source))
                    return
                count.received += 1
                try:
                    # Not with a tuple of arguments: it would have to be unpacked for each message.
                    if with_source:
                        callback(key, message, source)
                    else:
                        callback(key, message)
                except Exception:
                    log.exception(_FAULT, key)

            return take

        return DirectHandler(guarded, bind)

    def guarded(self, callback: Callable[[RawSample], object]) -> SampleHandler:
        """Calls `callback(sample)` for samples of a permitted size, and logs its exceptions."""

        def handle(sample: RawSample) -> None:
            # A message without bytes is a small one.
            if isinstance(sample.content, bytes) and (problem := size_problem(sample.content)):
                self._counters.drop(sample.key, problem)
                return
            try:
                callback(sample)
            except Exception:
                # A fault in one callback must not end the subscription, and no other code sees it after the bus.
                log.exception(_FAULT, sample.key)

        return handle

    def _refuse(self, sample: RawSample, message_type: type[Message]) -> bool:
        """Whether a sample is no message of this type on one key, whatever it holds; it is then counted as dropped."""
        key = sample.key
        if is_wildcard(key):
            self._counters.drop(key, "its key is a wildcard, not the name of one topic")
            return True
        encoding = sample.encoding
        if encoding != encoding_of(message_type) and encoding.startswith(_CDR):
            given, due = encoding.removeprefix(_CDR), message_type.ros_type
            self._counters.drop(key, f"wrong type: it is {given}, {due} is due")
            return True
        return False
