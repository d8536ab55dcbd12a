"""A process that takes part in lock-step, fed and asked by the test."""

from collections.abc import Callable

from zteam.bus import Bus
from zteam.messages import Bool, Tick, Twist
from zteam.node.lockstep import Participant
from zteam.node.process_node import ProcessNode
from zteam.node.shutdown import Stop

NAME = "planner"
INPUT = "camera/seen"


class Desk:
    """A process that takes part: it acts when it was fed as often as there are ticks."""

    def __init__(self, bus: Bus) -> None:
        self.node = ProcessNode(NAME, bus, Stop())
        self.acted: list[int] = []
        self.repeats = 0
        self.fed = 0
        self.needs_food = False
        self.command: Callable[[Tick], Twist | None] = lambda _: None
        self.part = Participant(self.node, self._ready, lambda _: [])
        self.part.repeat = self._repeat
        self.node.on_input = lambda: self.node.take_step(self.part.begin, self._act, self.part.answer)
        self._input = bus.publisher(INPUT, Bool)
        self.node.subscribe(INPUT, Bool, self._on_input)

    def _ready(self, tick: Tick) -> bool:
        return not (self.needs_food and "cook" in tick.participants) or self.fed >= tick.tick

    def _act(self, tick: Tick) -> Twist | None:
        self.acted.append(tick.tick)
        return self.command(tick)

    def _repeat(self) -> None:
        self.repeats += 1

    def feed(self) -> None:
        """Send it its input."""
        self._input.put(Bool(True))

    def _on_input(self, _key: str, _message: Bool) -> None:
        self.fed += 1
