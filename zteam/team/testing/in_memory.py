"""A behaviour's view by hand, and a node in the test's own process on a bus in memory.

The node works in lock-step: a test publishes its inputs and calls `tick`, and `step` has run when `tick` returns.
"""

import functools
import math
import threading
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from zteam import names
from zteam.bus import Bus, MemoryHub
from zteam.clock import HOST_FACTOR, to_ns, to_seconds
from zteam.errors import BusError, ZteamError
from zteam.messages import Done, Input, Message, Odometry, Tick, Twist, time_from_ns
from zteam.messages.base import DEFAULT_BASE, Base
from zteam.node.lockstep import TickState
from zteam.node.node import Node
from zteam.node.process_node import ClockMode
from zteam.node.shutdown import Stop
from zteam.robot.trials.situations import lookup_in, make_scan
from zteam.robot.view import View

LIMIT = 30.0 * HOST_FACTOR
"""Host seconds for the node's thread to begin or to end: many times what a crowded machine needs."""


def make_view(
    ranges: Sequence[float] | None = None,
    *,
    fov: float = math.pi,
    robot_id: int = 0,
    poses: Mapping[int, tuple[float, float, float]] | None = None,
    now: float = 1.0,
    dt: float = 0.1,
    odom: Odometry | None = None,
    base: Base = DEFAULT_BASE,
    seed: int = 1,
    inputs: Mapping[str, Any] | None = None,
) -> View:
    """What robot `robot_id` sees `now` (seconds), for `behavior.step(view)`.

    `ranges` are the metres of a laser's beams, evenly spread over `fov` radians from right to left, of up to 30 m; None
    is no scan yet. `poses` has x, y (m), yaw (rad) in `map` of the robots that are known; without them every look-up
    fails. `inputs` are what the behaviour declares, by name.
    """
    stamp = to_ns(now)
    return View(
        now=stamp,
        dt=dt,
        robot_id=robot_id,
        scan=None if ranges is None else make_scan(ranges, fov, stamp, robot_id),
        odom=odom,
        lookup=lookup_in(poses or {}, stamp),
        base=base,
        team=tuple(sorted(poses or ())),
        inputs=dict(inputs or {}),
        seed=seed,
    )


class RunningNode:
    """A node that runs in a thread, and a simulator by hand that gives it its ticks. A context manager."""

    def __init__(
        self,
        body: Callable[[Any], None],
        hub: MemoryHub,
        *,
        name: str = "node",
        robots: Sequence[int] = (),
        clock: ClockMode = "auto",
    ) -> None:
        """Run `body(node)`, as `zteam.run` takes it, in this process on `hub`: `with run_node(main, hub) as running:`.
        `robots` are the ids in the world: `step` waits for an `every_tick` input of `robot_$*/…` from each of them. The
        end of the `with` stops and closes the node, and raises the error that ended it."""
        self.bus: Bus = hub.bus()
        """The test's own session, which is the node's simulator too."""
        self._stop, self._body = Stop(), body
        self.node = Node(name, hub.bus(), self._stop, clock)
        self._robots = np.array(sorted(robots), np.int32)
        self._epoch, self._tick = 1, 0
        self._failure: BaseException | None = None
        self._up = threading.Event()
        self._answers: list[Done] = []
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._publisher = functools.cache(self.bus.publisher)
        self._ticks = self.bus.publisher(names.TICK, Tick)
        self._asked: dict[int, Input] = {}
        """The queries that the node has handed on, by number: those that a tick carries."""
        self.bus.subscribe(names.done_key(name), Done, self._on_done)
        self.bus.declare_token(names.lockstep_key(self.bus.instance))
        self.bus.declare_token(names.token_key(names.SIMULATOR, self.bus.instance))

    def __enter__(self) -> "RunningNode":
        self.node.on_present(self._up.set)
        self._thread.start()
        if not self._up.wait(LIMIT):
            raise ZteamError(f"{self.node.name}: node.run was not called within {LIMIT:g} s")
        if self._failure is not None or not self.node.present:
            self.__exit__(None)
            raise ZteamError(f"{self.node.name}: the body returned without node.run(step)")
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self._stop.request("the test is over")
        self._thread.join(LIMIT)
        self.node.close()
        self.bus.close()
        if kind is None:
            self._raise_failure()

    def _run(self) -> None:
        try:
            self._body(self.node)
        except BaseException as error:
            self._failure = error
        finally:
            self._up.set()

    def _on_done(self, _key: str, done: Done) -> None:
        self._answers.append(done)
        self._asked.update((each.number, each) for each in done.inputs)

    def _raise_failure(self) -> None:
        failure, self._failure = self._failure, None
        if failure is not None:
            raise failure

    @property
    def next_time(self) -> float:
        """Seconds of simulated time at the coming tick; ticks are 0.1 s apart."""
        return round(0.1 * (self._tick + 1), 9)

    def publish(self, key: str, message: Message) -> None:
        """Publish a message, with the coming tick's stamp where it has a header; its callbacks run in that tick."""
        for stamped in (message, *getattr(message, "transforms", ())):
            if hasattr(stamped, "header"):
                stamped.header.stamp = time_from_ns(to_ns(self.next_time))
        self._publisher(key, type(message)).put(message)

    def tick(self) -> Twist | None:
        """Let 0.1 s of simulated time pass. A `step` that is due has run when this returns its command, if any. Raises
        what `step` or a callback raised, and BusError where an input declared with `every_tick` is missing."""
        self._answers.clear()
        self._send_tick(self.node.name)
        self._tick += 1
        with self.node.changed:
            # The node may look for what is missing in its own thread just now, and take the tick after that.
            self.node.changed.wait_until(lambda: bool(self._answers) or self._leaves_tick(), LIMIT)
        if not self.node.can_publish:
            self._thread.join(LIMIT)
            self._raise_failure()
        if not self._answers:
            raise BusError(
                f"{self.node.name} waits for inputs of {to_seconds(self._tick * to_ns(0.1)):g} s: "
                "publish all that it declares with every_tick before tick(), "
                "and for a TransformListener the transforms from map to the base_footprint of each robot in `robots`"
            )
        answer = self._answers[-1]
        return answer.command if answer.has_command else None

    def _leaves_tick(self) -> bool:
        """Whether the node leaves the tick that was sent unanswered."""
        part = self.node.part
        is_open = part.tick is not None and part.tick.tick == self._tick and part.state is TickState.OPEN
        return not self.node.can_publish or self.node.stopping or (is_open and bool(self.node.lacking()))

    def reset(self) -> None:
        """Let simulated time begin again with the next tick. The node has heard of it when this returns."""
        self._epoch, self._tick = self._epoch + 1, 0
        # A tick that does not list the node only tells the time: the new time comes before its data.
        self._send_tick()

    def _send_tick(self, *listed: str) -> None:
        """Send the coming tick. The aggregator is listed, as in a team: inputs on `tf` are waited for."""
        stamp = time_from_ns(to_ns(self.next_time))
        listed = *listed, names.AGGREGATOR
        # The node passes over those that it has had.
        carried = list(self._asked.values())
        self._ticks.put(Tick(stamp, self._epoch, self._tick + 1, self._robots, [*listed], inputs=carried))


run_node = RunningNode
