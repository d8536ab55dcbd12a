"""A user's node in real time, beside a script of what happens meanwhile: its main loop runs in the test's own thread.

In lock-step `zteam.testing.run_node` does this.
"""

from collections.abc import Callable, Iterator

import zteam
from zteam.node.steps import Step


def play(node: zteam.Node, step: Step, script: Iterator[None], *, period: float = 0.1, gate: bool = False) -> None:
    """Run the main loop. Where it would wait the script goes on to its next `yield`; its end stops the node."""
    wait = node.wait

    def go_on(ready: Callable[[], bool], _timeout: float, **how: bool) -> bool:
        if not ready() and next(script, script) is script:
            node.stop.request("the test is over")
        return wait(ready, 0.0, **how)

    node.wait = go_on  # type: ignore[method-assign]
    node.run(step, period=period, gate=gate)
