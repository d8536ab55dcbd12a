"""What comes from outside in a run that is run again: what the ticks of its recording carried, and nothing else."""

from collections.abc import Iterable
from pathlib import Path

from zteam.bus import Bus
from zteam.messages import Input
from zteam.simulator.process.outside import Outside
from zteam.simulator.recorded_ticks import RecordedTick, read_ticks


class Recorded(Outside):
    """In place of `Outside`: what is sent now does not count."""

    def __init__(self, bus: Bus, file: Path) -> None:
        super().__init__(bus, lambda: None)
        self._ticks = read_ticks(file)
        self._number = 0

    def read(self, reads: Iterable[str]) -> None:
        pass

    def add(self, key: str, data: bytes, kind: str = Input.REQUEST, *, source: str = "", slot: str = "") -> None:
        pass

    def recorded(self, tick: int) -> RecordedTick | None:
        return self._ticks.get(tick)

    def _inputs(self, tick: int) -> list[Input]:
        known = self._ticks.get(tick)
        return [] if known is None else known.inputs

    def coming(self, tick: int) -> list[Input]:
        return [each for each in self._inputs(tick) if each.number > self._number]

    def take(self, joined: Iterable[str], tick: int, *, is_first: bool) -> tuple[list[Input], list[Input]]:
        inputs, new = self._inputs(tick), self.coming(tick)
        if new and not is_first:
            self._number = new[-1].number
        return [each for each in inputs if each not in new], new

    def start_anew(self) -> None:
        pass
