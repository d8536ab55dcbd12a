"""One node of a team in one process: its body in a thread of its own, and how it ended."""

import logging
import threading
from collections.abc import Callable

from zteam.in_process.delivery import marks_owner
from zteam.in_process.hub import TeamHub
from zteam.nodes.bodies import Part
from zteam.runtime.node import Node, stepping
from zteam.runtime.process_node import ProcessNode, run_body
from zteam.runtime.shutdown import Stop

log = logging.getLogger("zteam")


def own_part(body: Callable[[Node], None]) -> Part:
    """The part of a user's own node, whose body `zteam.run` would take as well."""
    return Part(stepping(body), Node)


class Member:
    """A node that runs. `on_end(member)` is called in its thread when it has ended."""

    def __init__(self, name: str, part: Part, hub: TeamHub, on_end: Callable[["Member"], None]) -> None:
        self.name = name
        self.exit_code: int | None = None
        """As of a process; None while it runs."""
        self.error: BaseException | None = None
        """What ended it, if that was an error."""
        self.stop = Stop()
        self.stopping = False
        """Whether it was asked to end."""
        self._part = part
        self._hub = hub
        self._on_end = on_end
        self._ended = threading.Event()
        self._ended.set()

    @property
    def running(self) -> bool:
        """Whether it has begun and not ended yet."""
        return not self._ended.is_set()

    def begin(self) -> None:
        """From now on it counts as running; `run` follows."""
        self._ended.clear()

    @marks_owner
    def run(self) -> None:
        """Run the node in this thread."""
        owner = self.name
        code = 1
        try:
            code = run_body(
                owner, lambda: self._hub.bus(owner), self._body, self.stop, self._part.clock, self._part.make
            )
        except SystemExit as error:
            code = error.code if isinstance(error.code, int) else int(error.code is not None)
        except BaseException as error:
            # Such as that of a debugger whose user quits.
            log.error("ended by %s", type(error).__name__)
        finally:
            self.exit_code = code
            # First: what `join` waits for has an end that is known.
            self._on_end(self)
            self._ended.set()

    def _body(self, node: ProcessNode) -> None:
        try:
            self._part.body(node)
        except BaseException as error:
            self.error = error
            raise

    def again(self) -> "Member":
        """A new member that does the same."""
        return Member(self.name, self._part, self._hub, self._on_end)

    def terminate(self) -> None:
        """Ask it to stop."""
        self.stopping = True
        self.stop.request("the team asks it to stop")

    def join(self, timeout: float) -> bool:
        """Wait until it has ended; False if it still runs after `timeout` host seconds."""
        return self._ended.wait(timeout)
