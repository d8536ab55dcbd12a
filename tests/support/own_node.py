"""A user's node on a bus in memory, with its main loop in a thread."""

import threading
from collections.abc import Callable

import zteam
from support.lockstep_doubles import LIMIT
from zteam import names
from zteam.bus import MemoryHub
from zteam.clock import wait_until
from zteam.messages import Twist
from zteam.runtime.shutdown import Stop


class Own:
    """A user's node with its main loop in a thread."""

    def __init__(self, hub: MemoryHub, name: str = "planner", command: Twist | None = None) -> None:
        self.stop = Stop()
        self.node = zteam.Node(name, hub.bus(), self.stop)
        self.steps: list[int] = []
        self.changed = threading.Condition()
        self.failure: BaseException | None = None
        self._command = command
        self._present = threading.Event()
        hub.bus().watch_tokens([names.tokens_key(name)], lambda key, alive: self._present.set())
        self._thread = threading.Thread(target=self._run, daemon=True)

    def step(self, now: int) -> Twist | None:
        """The user's step."""
        with self.changed:
            self.steps.append(now)
            self.changed.notify_all()
        return self._command

    def start(
        self, step: Callable[[int], Twist | None] | None = None, period: float = 0.1, *, gate: bool = False
    ) -> "Own":
        """Run the main loop."""
        self._chosen, self._period, self._gate = step or self.step, period, gate
        self._thread.start()
        return self

    def _run(self) -> None:
        try:
            self.node.run(self._chosen, period=self._period, gate=self._gate)
        except BaseException as error:
            self.failure = error

    def wait_until_present(self) -> None:
        """Wait until it holds its name."""
        assert self._present.wait(LIMIT)

    def wait_for_steps(self, count: int) -> None:
        """Wait until the step has run so often."""
        with self.changed:
            assert wait_until(self.changed, lambda: len(self.steps) >= count, LIMIT), self.steps

    def close(self) -> None:
        """Stop and wait."""
        self.stop.request("the test is over")
        if self._thread.ident is not None:
            self._thread.join(LIMIT)
        self.node.close()
