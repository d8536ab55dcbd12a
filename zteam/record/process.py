"""The recorder's process: what comes over the bus goes into a file.

In lock-step it takes part, so that the world does not leave it behind, and compares how many messages have come with
how many were sent.
"""

import threading
from collections import deque
from collections.abc import Mapping

from zteam import names
from zteam.bus.bus import SessionInfo, SessionRequest
from zteam.bus.transport import RawSample, matches
from zteam.clock import Every, monotonic, to_ns, wait_until
from zteam.config.numbers import counted
from zteam.errors import DecodeError, log
from zteam.messages.topics import is_latched, is_measured
from zteam.node.lockstep import TickState
from zteam.node.node import Node
from zteam.node.process_options import RecorderOptions
from zteam.node.steps import Due, NoSteps
from zteam.record.gathering import Gatherer, type_of_sample
from zteam.record.writing import Entry, RecordingWriter

_PERIOD = 0.05
"""Host seconds between two looks at what has come."""
_FLUSH = 0.9
"""Host seconds after which what was recorded outlives the recorder."""
_MOST = 64 << 20
"""Bytes that may wait to be written. What comes beyond them is lost in real time; in lock-step the world waits."""
_OBJECT = 1000
"""Bytes that a message within this process is taken for."""
_MOST_TYPES = 256
"""Encodings that are looked at."""
_LIMIT = 10.0
"""Host seconds that a tick waits for that."""
_HISTORY = 2.0
"""Host seconds for the last messages of latched publishers, where no tick says that they have come."""


class Recorder:
    """Bus threads bring messages; the main loop writes them."""

    def __init__(self, node: Node, options: RecorderOptions, contents: Mapping[str, bytes]) -> None:
        self._node, self._options = node, options
        facts = {"command": options.command, "keys": " ".join(options.keys)}
        if options.launch is not None:
            facts["seed"] = str(options.seed)
        if options.last is not None:
            facts["last"] = str(options.last)
        self.writer = RecordingWriter(options.file, facts, contents, force=options.force)
        self.gathered = Gatherer(node.part.ticks.simulators)
        self._arrived: deque[RawSample] = deque()
        self._bytes = 0
        self._room = threading.Condition()
        self.writing = threading.RLock()
        """Held while the file is written."""
        self._met: set[str] = set()
        """The encodings of messages, which were looked at once."""
        self.lost = 0
        self.first_data = 0.0
        """Host time of the first message of a base; 0 before."""
        self._latched: dict[tuple[str, str], RawSample] | None = {}
        """The last messages of latched publishers, by key and session, until all are there."""
        self._kept: deque[Entry] = deque()
        self._older: dict[str, Entry] = {}
        """With `last`: its messages, and the newest older one of each latched key."""
        self._live: set[tuple[str, bytes]] = set()
        """What has come meanwhile: the same may be in both."""
        node.bus.subscribe_raw("**", self._receive, from_others=True, screened=False)
        self._history = node.bus.subscribe_raw("**", self._keep, latched=True, from_others=True, screened=False)

    def _receive(self, sample: RawSample) -> None:
        with self._room:
            if not self.first_data and is_measured(sample.key):
                self.first_data = monotonic()
            if self._bytes > _MOST and not self._node.part.expected:
                self.lost += 1
                return
            self._bytes += len(sample.content) if isinstance(sample.content, bytes) else _OBJECT
            self._arrived.append(sample)

    def _keep(self, sample: RawSample) -> None:
        if (latched := self._latched) is not None:
            latched[sample.key, sample.source] = sample.apart()

    def make_room(self) -> None:
        """Wait until what has come is written, where that is too much."""
        with self._room:
            wait_until(self._room, lambda: self._bytes < _MOST or self._node.stopping, _LIMIT)

    def end_history(self) -> None:
        """All that was latched before is there."""
        if self._latched is None or not self._is_timed():
            return
        self._history.close()
        self.drain()
        latched, self._latched = self._latched, None
        for sample in latched.values():
            if (sample.key, sample.payload) not in self._live:
                self._learn(sample)
                self._put(self.gathered.beside(sample))
        self._live.clear()

    def drain(self, *, may_ask: bool = True) -> None:
        """Write what has come, once it is known what time that is. Unless it `may_ask` other sessions, not what comes
        behind a message of an unknown type. Raises OSError."""
        clock = self._node.clock
        with self.writing:
            if not self._is_timed():
                return
            if not clock.simulated or not self.gathered.time:
                self.gathered.time = clock.now()
            while self._arrived and (may_ask or self._arrived[0].encoding in self._met):
                self._take(self._arrived.popleft())
        with self._room:
            self._bytes = 0
            self._room.notify_all()

    def _take(self, sample: RawSample) -> None:
        if self._latched is not None:
            self._live.add((sample.key, sample.payload))
        if sample.encoding not in self._met:
            self._learn(sample)
        try:
            for entry in self.gathered.take(sample):
                self._put(entry)
        except DecodeError as error:
            self._node.bus.counters.drop(sample.key, str(error))

    def write_behind(self) -> None:
        """In lock-step: write what has come, in the thread of the bus that has answered the tick. A second thread would
        keep it from receiving: Python runs one at a time, and each message waits for its turn."""
        if self._node.part.state is not TickState.ANSWERED or self._latched is not None:
            return
        # The main loop may wait for an answer, which comes over this very thread.
        if not self.writing.acquire(blocking=False):
            return
        try:
            self.drain(may_ask=False)
        except OSError as error:
            self._node.fail(error)
        finally:
            self.writing.release()

    def _is_timed(self) -> bool:
        """Whether it is known what time it is. At the end that is waited for no longer."""
        return self._node.clock.now() > 0 or self._node.stopping

    def _put(self, entry: Entry) -> None:
        keys = self._options.keys
        if not self.writer.knows(entry.type) or (keys and not any(matches(each, entry.key) for each in keys)):
            return
        if self._options.last is None:
            self._write(entry)
            return
        self._kept.append(entry)
        while self._kept[0].time < entry.time - to_ns(self._options.last):
            old = self._kept.popleft()
            if is_latched(old.key):
                self._older[old.key] = old

    def end(self) -> None:
        """Write what waits until the end."""
        self.end_history()
        self.drain()
        for entry in self.gathered.rest():
            self._put(entry)
        self._write_kept()

    def _write_kept(self) -> None:
        """With `last`: write what was kept, after the last messages of latched keys from before."""
        for entry in (*self._older.values(), *self._kept):
            self._write(entry)

    def _write(self, entry: Entry) -> None:
        if problem := self.writer.put(entry):
            self._node.bus.counters.drop(entry.key, problem)

    def _learn(self, sample: RawSample) -> None:
        """An encoding comes for the first time: ask the session that publishes a type of the user's own for its
        definition."""
        kind = type_of_sample(sample)
        if len(self._met) < _MOST_TYPES:
            self._met.add(sample.encoding)
        elif not self.writer.knows(kind):
            # A sender can invent types.
            return
        if self.writer.knows(kind):
            return
        asked = names.session_info_key(sample.source)
        answers = self._node.bus.find(asked, SessionInfo, SessionRequest(type=kind)) if kind else []
        found = next((info.definition for _, info in answers if info.definition), "")
        if found:
            self.writer.define(kind, found)
        else:
            what = f"its type {kind} is not known" if kind else "its messages name no type"
            log.warning("%s is left out: %s", sample.key, what)

    def facts(self) -> dict[str, str]:
        """What the recording says of itself at its end."""
        gathered = self.gathered
        found = {
            "ticks": str(gathered.ticks),
            "is_whole": str(gathered.is_whole and not gathered.gaps),
            "lost": str(self.lost),
            "missed": str(gathered.missed),
        }
        if gathered.gaps:
            found["gaps"] = "\n".join(gathered.gaps)
        if gathered.stray:
            found["stray"] = "\n".join(f"{name} {key}" for name, key in gathered.stray.items())
        return found


def run_recorder(node: Node, options: RecorderOptions, contents: Mapping[str, bytes]) -> None:
    """Record until the process is asked to stop; `contents` are the attachments."""
    recorder = Recorder(node, options, contents)

    def act(_due: Due) -> None:
        recorder.make_room()

    node.adopt(act, NoSteps(node))
    advance = node.on_input

    def on_input() -> None:
        advance()
        recorder.write_behind()

    node.on_input = on_input
    began, flush = Every(_HISTORY), Every(_FLUSH)
    began.due()
    flush.due()
    node.become_present()
    log.info("recording to %s", options.file)
    try:
        while not node.stopping:
            node.wait(lambda: False, _PERIOD, by_inputs=False)
            node.decide_clock(recorder.first_data)
            if node.part.state not in (TickState.NONE, TickState.UNLISTED) or began.due():
                recorder.end_history()
            recorder.drain()
            if flush.due():
                with recorder.writing:
                    recorder.writer.flush()
        recorder.end()
        recorder.writer.finish(recorder.facts())
    except OSError as error:
        recorder.writer.abandon()
        text = "%s: %s: the recording ends here; 'zteam recording recover' makes it whole"
        log.error(text, options.file, error.strerror)
        # The process may have been asked to stop already.
        node.exit_code = 1
        return
    gathered = recorder.gathered
    for name, key in gathered.stray.items():
        log.warning("%s publishes %s outside of its steps, so the run does not repeat", name, key)
    if gathered.missed:
        log.warning("of %s no clock has come: messages may be lost", counted(gathered.missed, "tick"))
    if recorder.lost:
        log.warning("%s could not be written in time, and are lost", counted(recorder.lost, "message"))
    if gathered.gaps:
        log.error("%s lacks messages, so it proves nothing: %s", options.file, gathered.gaps[0])
        node.exit_code = 1
        return
    log.info("%s has %s", options.file, counted(recorder.writer.count, "message"))
