"""What comes from outside in a run that is run again: what the ticks of its recording carried, and nothing else."""

from collections.abc import Iterable
from pathlib import Path

from zteam.bus import Bus
from zteam.messages import Input
from zteam.simulator.process.outside import Outside
from zteam.simulator.recorded_ticks import read_inputs


class Recorded(Outside):
    """In place of `Outside`: what is sent now does not count."""

    def __init__(self, bus: Bus, file: Path) -> None:
        super().__init__(bus, lambda: None)
        self._inputs = read_inputs(file)
        self._number = 0

    def read(self, reads: Iterable[str]) -> None:
        pass

    def add(self, key: str, data: bytes, kind: str = Input.REQUEST, *, source: str = "", slot: str = "") -> None:
        pass

    def coming(self, tick: int) -> list[Input]:
        return [each for each in self._inputs.get(tick, ()) if each.number > self._number]

    def take(self, joined: Iterable[str], tick: int, *, is_first: bool) -> tuple[list[Input], list[Input]]:
        inputs, new = self._inputs.get(tick, []), self.coming(tick)
        if new and not is_first:
            self._number = new[-1].number
        return [each for each in inputs if each not in new], new

    def start_anew(self) -> None:
        pass
