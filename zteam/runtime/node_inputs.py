"""The messages of a user's own node: when they are handled, and which of them its step waits for."""

from collections.abc import Callable
from itertools import count
from typing import Any

from zteam.clock import monotonic
from zteam.messages import Message, NavigationStatus, RobotStatus, TeamStatus, Tick, Twist
from zteam.runtime.node import Node
from zteam.runtime.participant import Participant
from zteam.runtime.tick_inputs import TickInputs, stamp_of_tick
from zteam.runtime.tick_messages import Arrival, TickMessages

_OF_PROCESSES = (RobotStatus, NavigationStatus, TeamStatus)
"""What processes say of themselves: they say it before there is a simulator, too, so it does not tell of a base."""


class NodeInputs:
    """Handles what a node subscribes to, and is its part in lock-step. Everything runs under `node.changed`."""

    def __init__(self, node: Node, act: Callable[[Tick], Twist | None]) -> None:
        """`act(tick)` is the node's work in a tick, as for `Participant`."""
        self._node = node
        self.of_ticks = TickInputs(lambda: self.part.robots)
        self._messages = TickMessages()
        self._numbers = count()
        self.first_data = 0.0
        """Host time of the first message that may be of a base; 0 before."""
        self.part = Participant(node, self._are_complete, act, lacks=self.of_ticks.lacking)
        node.on_time_reset(self.of_ticks.forget)
        node.on_time_reset(self._messages.forget)

    def _are_complete(self, tick: Tick) -> bool:
        self._messages.handle_due(self.part.stamp)
        return self._node.speaks and not self.of_ticks.lacking(tick)

    def handle_rest(self) -> None:
        """There are no ticks any more: handle what waits for one."""
        self._messages.handle_due(None)

    def handler(self, callback: Callable[[str, Any], None], *, at_once: bool, every_tick: bool) -> Callable[..., None]:
        """`take(key, message, source)` for the messages of one subscription, for `callback(key, message)`.

        It is called `at_once`, or when the message counts. `every_tick` says whether the node's step waits for them.
        """
        number, failing, part = next(self._numbers), self._node.failing(), self.part
        ended, clock = self._node.ended_time, self._node.clock

        def handle(key: str, message: Message) -> None:
            with failing:
                callback(key, message)

        def take(key: str, message: Message, source: str = "") -> None:
            # A latched message may be the aggregator's, which is there before the simulator.
            if not (at_once or isinstance(message, _OF_PROCESSES)):
                self.first_data = self.first_data or monotonic()
            if (
                ended.may_be_heard
                and (every_tick or isinstance(message, RobotStatus))
                and ended.has(key, lambda: stamp_of_tick(message), clock.now())
            ):
                return
            due = self.of_ticks.take(key, message) if every_tick else None
            if at_once or not part.active:
                handle(key, message)
            else:
                arrival = Arrival(number, key, message, source, part.is_simulator(source), due, handle)
                if problem := self._messages.take(arrival, part.stamp, is_open=part.is_open):
                    self._node.bus.counters.drop(key, problem)
            if due is not None:
                part.take_stamp(due)
            part.advance()

        return take
