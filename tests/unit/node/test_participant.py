"""A participant and a simulator by script: joining, answering once, repeats, the time that ticks tell, which of them
count, and what ends lock-step."""

from collections.abc import Callable, Iterator
from contextlib import closing

import numpy as np
import pytest

from support.limits import LIMIT
from support.lockstep_doubles import INTERVAL, ScriptedSimulator, show_simulator
from support.log_capture import LogCapture, captured_log
from zteam import names
from zteam.bus import Bus, MemoryHub
from zteam.errors import ZteamError
from zteam.messages import Bool, Done, Input, Tick, Twist, Vector3, time_from_ns
from zteam.node.lockstep import Participant, TickState
from zteam.node.process_node import ProcessNode
from zteam.node.shutdown import Stop

NAME = "planner"
REFUSED = "dropped a message on sim/tick"


class Desk:
    """A process that takes part: it acts when it was fed as often as there are ticks."""

    def __init__(self, bus: Bus) -> None:
        self.node = ProcessNode(NAME, bus, Stop())
        self.acted: list[int] = []
        self.repeats = 0
        self.fed = 0
        self.needs_food = False
        self.command: Callable[[Tick], Twist | None] = lambda _: None
        self.part = Participant(self.node)
        self.part.repeat = self._repeat
        self.node.on_input = lambda: self.node.take_step(self._begin, self._act, self.part.answer)
        self._input = bus.publisher("camera/seen", Bool)
        self.node.subscribe("camera/seen", Bool, self._on_input)

    def _begin(self) -> Tick | None:
        tick, is_open = self.part.tick, self.part.state is TickState.OPEN
        if tick is None or not is_open or (self.needs_food and "cook" in tick.participants and self.fed < tick.tick):
            return None
        self.part.begin()
        return tick

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


@pytest.fixture
def script(hub: MemoryHub) -> ScriptedSimulator:
    """A simulator with its token."""
    script = ScriptedSimulator(hub, NAME)
    script.appear()
    return script


@pytest.fixture
def desk(hub: MemoryHub, script: ScriptedSimulator) -> Iterator[Desk]:
    """A present process that has just asked to be let in, and heard that it is (ticks from 2 on are for it)."""
    desk = Desk(hub.bus())
    desk.node.become_present()
    script.tick(1)
    assert script.take() == [Done(1, 1)]
    yield desk
    desk.node.close()


FEED = 0
"""Its input comes: it has to have come as often as there were ticks, while a `cook` takes part."""
ANSWERS: dict[str, tuple[list[int | tuple[int | str, ...]], list[int], list[int], int]] = {
    "a newcomer asks to be let in": ([(2, "robot_0"), (3, NAME, "robot_0")], [2, 3], [3], 0),
    "also into the tick that is open": ([(5,), (5, NAME)], [5, 5], [5], 0),
    "it waits for its inputs": ([(2, NAME, "cook"), FEED], [], [], 0),
    "and acts once when they are there": ([(2, NAME, "cook"), FEED, FEED, FEED], [2], [2], 0),
    "inputs may come before their tick": ([FEED, FEED, (2, NAME, "cook")], [2], [2], 0),
    "a repeated tick is answered and not acted on again": ([(2, NAME), (2, NAME), (2, NAME)], [2, 2, 2], [2], 2),
    "one that waits for inputs goes on waiting": ([(2, NAME, "cook"), (2, NAME, "cook"), FEED], [], [], 0),
    "and is then acted on once": ([(2, NAME, "cook"), (2, NAME, "cook"), FEED, FEED], [2], [2], 0),
    "it may say that others have left": ([(2, NAME, "cook"), (2, NAME)], [2], [2], 0),
    "a newer tick ends the wait for an older one": ([(2, NAME, "cook"), (3, "cook"), FEED, FEED, FEED], [3], [], 0),
    "left behind and let in again": ([(2, NAME, "cook"), (3, "cook"), (4, NAME)], [3, 4], [4], 0),
}  # fmt: skip


@pytest.mark.parametrize("case", ANSWERS)
def test_each_tick_is_answered_once_its_inputs_are_there(desk: Desk, script: ScriptedSimulator, case: str) -> None:
    """Of ticks with these participants: the answers, the ticks that were acted on, and the repeats of what was sent."""
    events, answered, acted, repeats = ANSWERS[case]
    desk.needs_food = True
    for event in events:
        if isinstance(event, tuple):
            number, *listed = event
            script.tick(int(number), *map(str, listed))
        else:
            desk.feed()
    assert (script.take(), desk.acted, desk.repeats) == ([Done(1, tick) for tick in answered], acted, repeats)


def test_it_asks_to_be_let_in_when_latched_messages_have_come(hub: MemoryHub, script: ScriptedSimulator) -> None:
    """At once, for the newest tick, and not before; not if it is listed meanwhile."""
    desk, waiting = Desk(hub.bus()), list[Callable[[], object]]()
    desk.node.bus.transport.when_caught_up = waiting.append  # type: ignore[method-assign]
    with closing(desk.node):
        desk.node.become_present()
        script.tick(1)
        script.tick(2)
        assert script.take() == []
        waiting.pop()()
        assert (script.take(), waiting) == ([Done(1, 2)], [])
        script.tick(3)
        script.tick(4, NAME)
        waiting.pop()()
        assert script.take() == [Done(1, 4)]


def test_a_command_travels_with_the_answer(desk: Desk, script: ScriptedSimulator) -> None:
    """A repeated tick is answered with the same one. The tick of another epoch is another tick: GO opens the held first
    one anew."""
    desk.command = lambda tick: Twist(Vector3(0.1 * (1 + len(desk.acted)))) if tick.tick % 2 else None
    for tick, epoch in ((2, 0), (3, 0), (3, 0), (3, 4)):
        script.tick(tick, NAME, epoch=epoch)
    commands = [Done(epoch, 3, True, Twist(Vector3(0.1 * n))) for epoch, n in ((0, 3), (0, 3), (4, 4))]
    assert script.take() == [Done(0, 2), *commands]
    assert desk.acted == [2, 3, 3]


def test_a_request_changes_a_process_and_a_message_does_not(desk: Desk, script: ScriptedSimulator) -> None:
    """Also with the same key. A message reaches who subscribes to the key, and a request does not; one for another
    process is passed over. What comes again, for one that joins, is not taken again."""
    changed, heard = list[bytes](), list[bytes]()
    desk.part.changes["planner/set/now"] = changed.append
    desk.node.bus.subscribe_raw("planner/set/*", lambda sample: heard.append(sample.payload))
    sent = [
        ("planner/set/now", "", b"word"),
        ("planner/set/now", Input.REQUEST, b"{}"),
        ("planner/set/other", Input.REQUEST, b"[]"),
    ]
    inputs = [Input(n, key, kind, np.frombuffer(data, np.uint8)) for n, (key, kind, data) in enumerate(sent, 1)]
    script.tick(2, NAME, inputs=inputs)
    script.tick(3, NAME, inputs=inputs)
    assert (changed, heard) == ([b"{}"], [b"word"])


def test_who_does_not_hold_its_name_says_nothing(hub: MemoryHub, script: ScriptedSimulator) -> None:
    """Before the name is won another process may have it, so ticks are neither heard nor answered; the clock is."""
    desk = Desk(hub.bus())
    script.tell(5 * INTERVAL)
    script.tick(1, NAME)
    script.tick(2)
    desk.feed()
    assert (script.answers, desk.acted, desk.part.tick, desk.fed) == ([], [], None, 1)
    assert desk.node.clock.now() == 5 * INTERVAL
    desk.node.become_present()
    script.tick(2)
    assert script.take() == [Done(1, 2)]
    assert desk.part.tick is not None
    desk.node.close()


def test_a_robot_that_left_and_is_back_in_the_next_tick_is_a_newcomer(desk: Desk, script: ScriptedSimulator) -> None:
    """The team has the same robots and is another one: what the old process was told the new one has not heard."""
    script.tick(2, NAME, "robot_7", "robot_3")
    team = desk.part.team
    assert team == (3, 7)
    script.tick(3, NAME, "robot_7", "robot_3")
    assert desk.part.team is team
    script.tick(3, NAME)
    assert desk.part.team is team, "nothing changes within a tick"
    script.tick(4, NAME, "robot_7", "robot_3")
    assert desk.part.team == team
    assert desk.part.team is not team


@pytest.mark.parametrize("fails", [True, False])
def test_a_step_that_fails_or_stops_its_process_does_not_answer(
    desk: Desk, script: ScriptedSimulator, fails: bool
) -> None:
    """What it raises is raised where the process waits. The tick then ends when its token has gone, so all know in
    which tick it left."""

    def act(_: Tick) -> Twist | None:
        if fails:
            raise ZteamError("no path")
        desk.node.stop.request("it has done its work")
        return Twist()

    desk.command = act
    script.tick(2, NAME)
    assert (desk.acted, script.take()) == ([2], [])
    if fails:
        with pytest.raises(ZteamError, match="no path"):
            desk.node.wait(lambda: True, LIMIT)


@pytest.mark.parametrize("late", ["tick", "input"])
def test_nothing_is_answered_behind_the_stop_hooks(desk: Desk, script: ScriptedSimulator, late: str) -> None:
    """A hook has the last word, such as a zero velocity: a tick or an input that comes after it does nothing."""
    desk.needs_food = late == "input"
    script.tick(2, NAME, "cook")
    script.take()
    acted = [*desk.acted]

    def go_on() -> None:
        if late == "input":
            desk.feed()
            desk.feed()
        else:
            script.tick(3, NAME)

    desk.node.on_stop(go_on)
    desk.node.close()
    assert (script.take(), desk.acted) == ([], acted)


# Time


def test_time_goes_with_the_ticks(desk: Desk, script: ScriptedSimulator) -> None:
    """Each tick sets the time, and the clock, which would only wake the process once more, is not heard. A jump back,
    which a repeated tick is not, is told before the tick is acted on."""
    order: list[str] = []
    desk.node.clock.on_jump_back(lambda old, new: order.append(f"{old // INTERVAL} -> {new // INTERVAL}"))
    desk.command = lambda tick: order.append(f"act {tick.tick} at {desk.node.clock.now() // INTERVAL}")
    for tick in (8, 9, 9, 2, 3):
        script.tick(tick, NAME)
    assert order == ["act 8 at 8", "act 9 at 9", "9 -> 2", "act 2 at 2", "act 3 at 3"]
    script.tell(77 * INTERVAL)
    assert (desk.node.clock.now(), desk.part.stamp) == (3 * INTERVAL, 3 * INTERVAL)
    assert desk.node.clock.simulated


@pytest.mark.parametrize("other", [False, True])
def test_lock_step_ends_with_its_token(hub: MemoryHub, desk: Desk, script: ScriptedSimulator, other: bool) -> None:
    """The participant is idle, inputs cause no answer, and the clock counts, also where a simulator in real time is
    there by then. The next one in lock-step numbers its ticks from 1: they are acted on, though they were answered
    before."""
    desk.needs_food = True
    script.tick(2, NAME, "cook")
    real_time = ScriptedSimulator(hub, NAME)
    if other:
        show_simulator(real_time.bus, lockstep=False)
    script.vanish()
    assert desk.node.wait(lambda: desk.part.tick is None, LIMIT)
    for _ in range(2):
        desk.feed()
    assert (script.take(), desk.acted, desk.node.clock.now()) == ([], [], 2 * INTERVAL)
    real_time.tell(9 * INTERVAL)
    assert desk.node.clock.now() == 9 * INTERVAL
    script.appear()
    assert desk.part.tick is None
    for _ in range(2):
        script.tick(2, NAME)
    assert (script.take(), desk.acted, desk.repeats) == ([Done(1, 2)] * 2, [2], 1)


# Which ticks count


@pytest.fixture
def log() -> Iterator[LogCapture]:
    """What is logged during the test."""
    with captured_log() as lines:
        yield lines


def forge(hub: MemoryHub, tick: int, *participants: str) -> None:
    """A tick from a session that is no simulator."""
    publisher = hub.bus().publisher(names.TICK, Tick)
    publisher.put(Tick(time_from_ns(tick * INTERVAL), 1, tick, participants=list(participants)))


@pytest.mark.gate
def test_a_tick_that_no_simulator_sent_stops_no_team_in_real_time(hub: MemoryHub, log: LogCapture) -> None:
    """It is neither answered nor taken for the time, and the log and the counters say that it came."""
    script, desk = ScriptedSimulator(hub, NAME), Desk(hub.bus())
    show_simulator(script.bus, lockstep=False)
    desk.node.become_present()
    forge(hub, 0, NAME)
    forge(hub, 0)
    log.wait_for(REFUSED)
    assert (script.answers, desk.acted, desk.part.tick) == ([], [], None)
    script.tell(6 * INTERVAL)
    assert desk.node.clock.now() == 6 * INTERVAL
    assert desk.node.bus.counters.snapshot()[names.TICK].dropped == 1
    desk.node.close()


@pytest.mark.gate
def test_a_tick_that_no_simulator_sent_does_not_count_in_lock_step(
    hub: MemoryHub, desk: Desk, script: ScriptedSimulator, log: LogCapture
) -> None:
    """Beside a simulator in lock-step, only that one's ticks are answered."""
    script.tick(2, NAME)
    forge(hub, 900, NAME)
    forge(hub, 901, NAME)
    log.wait_for(REFUSED)
    script.tick(3, NAME)
    assert (script.take(), desk.acted) == ([Done(1, 2), Done(1, 3)], [2, 3])
    assert desk.node.clock.now() == 3 * INTERVAL


def test_a_tick_may_come_before_the_simulators_token(hub: MemoryHub) -> None:
    """Nothing orders the two: the tick is kept, and answered when the token has come."""
    script, desk = ScriptedSimulator(hub, NAME), Desk(hub.bus())
    desk.node.become_present()
    script.tick(1)
    assert script.take() == []
    script.appear()
    assert script.take() == [Done(1, 1)]
    desk.node.close()
