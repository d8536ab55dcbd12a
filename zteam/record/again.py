"""What a recording says of its run, for another run of it, and whether that can be the same."""

from pathlib import Path
from typing import NamedTuple

from zteam import names
from zteam.errors import DecodeError, UsageError
from zteam.messages import Tick, decode
from zteam.record.recording import Recording
from zteam.simulator.recorded_ticks import RecordedTick, recorded_ticks


class RecordedRun(NamedTuple):
    """A run in lock-step from its first tick on."""

    version: str
    """Of the zteam that has recorded it."""
    contents: dict[str, bytes]
    """The attachments, by name."""
    sent: list[bytes]
    """The messages of `sim/tick`, in order."""
    ticks: dict[int, RecordedTick]
    """By number."""

    @property
    def last(self) -> int:
        """The number of the last tick."""
        return max(self.ticks)


def read_run(path: Path) -> RecordedRun:
    """Raises UsageError for what cannot be run again, with the reason."""
    recording = Recording(path)
    sent = [entry.data for entry in recording.entries(names.TICK) if entry.tick]
    try:
        read = [decode(Tick, each) for each in sent]
    except DecodeError as error:
        raise UsageError(f"{path}: cannot be run again: {error}") from None
    if reason := _why_not(recording, [each.tick for each in read]):
        raise UsageError(f"{path}: cannot be run again: {reason}")
    return RecordedRun(recording.facts["version"], recording.contents, sent, recorded_ticks(read))


def _why_not(recording: Recording, numbers: list[int]) -> str:
    """Why it cannot be run again; empty if it can."""
    facts, end = recording.facts, recording.end_facts
    if facts.get("keys"):
        return f"of its keys only {facts['keys']} were recorded"
    if "last" in facts:
        return f"it has the last {facts['last']} s alone"
    if not numbers:
        return "it is of real time, and only lock-step repeats (zteam up --lockstep --record)"
    if numbers[0] != 1:
        return "it began in the middle of the run"
    if numbers != sorted(numbers):
        return "its world was put back to the start"
    if stray := end.get("stray"):
        return f"a process published outside of its steps: {stray}"
    return end.get("gaps", "")
