"""The file by which a launcher hands the ticks of a recording to the simulator that runs them again."""

from collections.abc import Iterable
from pathlib import Path

from zteam.messages import Input, Tick, decode

_LENGTH = 4
"""Bytes, little endian, before those of each tick."""


def write_ticks(file: Path, ticks: Iterable[bytes]) -> None:
    """Write the bytes of ticks for `read_inputs`."""
    file.write_bytes(b"".join(len(each).to_bytes(_LENGTH, "little") + each for each in ticks))


def read_inputs(file: Path) -> dict[int, list[Input]]:
    """The inputs of each tick that has some, by its number. Of a tick that is there several times the last one counts.
    Raises DecodeError."""
    data, inputs = memoryview(file.read_bytes()), dict[int, list[Input]]()
    while data:
        size = _LENGTH + int.from_bytes(data[:_LENGTH], "little")
        tick = decode(Tick, bytes(data[_LENGTH:size]))
        inputs[tick.tick] = tick.inputs
        data = data[size:]
    return {number: each for number, each in inputs.items() if each}
