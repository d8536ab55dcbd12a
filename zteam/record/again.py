"""What a recording says of its run, for another run of it, and whether that can be the same."""

from pathlib import Path
from typing import NamedTuple

from mcap.exceptions import McapError
from mcap.reader import make_reader

from zteam import names
from zteam.errors import UsageError
from zteam.messages import Tick, decode
from zteam.record.writing import FACTS
from zteam.simulator.recorded_ticks import RecordedTick, recorded_ticks


class RecordedRun(NamedTuple):
    """A run in lock-step from its first tick on."""

    facts: dict[str, str]
    contents: dict[str, bytes]
    """The attachments, by name."""
    ticks: list[bytes]
    """The messages of `sim/tick`; the last one of each tick holds."""
    last: int
    """The number of the last tick."""
    by_number: dict[int, RecordedTick]


def read_run(path: Path) -> RecordedRun:
    """Raises UsageError for what cannot be run again, with the reason."""
    facts, contents, ticks = dict[str, str](), dict[str, bytes](), list[bytes]()
    try:
        with path.open("rb") as file:
            reader = make_reader(file)
            for metadata in reader.iter_metadata():
                facts |= metadata.metadata if metadata.name == FACTS else {}
            contents = {each.name: each.data for each in reader.iter_attachments()}
            for _, _, message in reader.iter_messages(topics=[f"/{names.TICK}"]):
                ticks.append(message.data)
    except OSError as error:
        raise UsageError(f"{path}: {error.strerror}") from None
    except McapError as error:
        raise UsageError(f"{path}: cannot be read as a recording: {error}") from None
    if not ticks:
        raise UsageError(f"{path}: cannot be run again: {_why_not(facts)}")
    if facts.get("is_whole") != "True":
        raise UsageError(f"{path}: cannot be run again: {facts.get('gaps', 'it does not begin with the first tick')}")
    if stray := facts.get("stray"):
        raise UsageError(f"{path}: cannot be run again: published outside of a step: {stray}")
    if last := facts.get("last"):
        raise UsageError(f"{path}: cannot be run again: it has the last {last} s alone")
    if facts.get("keys"):
        raise UsageError(f"{path}: cannot be run again: of its keys only {facts['keys']} were recorded")
    read = [decode(Tick, each) for each in ticks]
    numbers = [each.tick for each in read]
    if numbers != sorted(numbers):
        raise UsageError(f"{path}: cannot be run again: its world was put back to the start")
    return RecordedRun(facts, contents, ticks, numbers[-1], recorded_ticks(read))


def _why_not(facts: dict[str, str]) -> str:
    if "version" not in facts:
        return "zteam has not recorded it"
    return "it is of real time, and only lock-step repeats (zteam up --lockstep --record)"
