"""The ticks of a recording: the inputs of each, and what took part in it. A launcher hands them in a file to the
simulator that runs them again."""

from collections.abc import Iterable
from pathlib import Path

import msgspec

from zteam.messages import Input, Tick, decode

_LENGTH = 4
"""Bytes, little endian, before those of each tick."""


class RecordedTick(msgspec.Struct):
    """A tick, which may have been sent several times."""

    inputs: list[Input]
    members: frozenset[str]
    """The participants when it was opened."""
    leaving: frozenset[str]
    """Those that have ended while it was open."""


def recorded_ticks(sent: Iterable[Tick]) -> dict[int, RecordedTick]:
    """By number, from the ticks as they were sent. What the held first tick was before GO does not count."""
    found, epochs = dict[int, RecordedTick](), dict[int, int]()
    for tick in sent:
        listed = frozenset(tick.participants)
        if epochs.get(tick.tick) != tick.epoch:
            epochs[tick.tick] = tick.epoch
            found[tick.tick] = RecordedTick(tick.inputs, listed, frozenset())
        else:
            known = found[tick.tick]
            # Before GO, and while the first tick is held, it may gain some.
            known.members |= listed
            known.inputs, known.leaving = tick.inputs, known.members - listed
    return found


def write_ticks(file: Path, ticks: Iterable[bytes]) -> None:
    """Write the bytes of ticks for `read_ticks`."""
    file.write_bytes(b"".join(len(each).to_bytes(_LENGTH, "little") + each for each in ticks))


def read_ticks(file: Path) -> dict[int, RecordedTick]:
    """Raises DecodeError."""
    data, sent = memoryview(file.read_bytes()), list[Tick]()
    while data:
        size = _LENGTH + int.from_bytes(data[:_LENGTH], "little")
        sent.append(decode(Tick, bytes(data[_LENGTH:size])))
        data = data[size:]
    return recorded_ticks(sent)
