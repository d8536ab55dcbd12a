"""Lock-step with messages that are lost and participants that are silent: repeated, named, left behind."""

from itertools import pairwise

import pytest

from support.lockstep_doubles import LIMIT, SHORT, Player, Worlds, listening, lose_first, lossy_bus, make_team
from zteam import names
from zteam.bus import MemoryHub
from zteam.clock import monotonic
from zteam.messages import Done
from zteam.nodes.simulator import lockstep


@pytest.mark.usefixtures("hasty")
@pytest.mark.parametrize("lost", [names.TICK, names.done_key("robot_0")])
def test_a_lost_message_costs_a_repeat(hub: MemoryHub, worlds: Worlds, lost: str) -> None:
    """Whether the tick or its answer does not arrive, the tick is sent again, and that is counted."""
    losing = [False]
    lose = lose_first(lost)
    bus = lossy_bus(hub, lambda key: losing[0] and lose(key))
    world = worlds(bus=bus if lost != names.TICK else None)
    robot = Player(hub, "robot_0", bus=bus if lost == names.TICK else None).appear()
    world.open(1)
    assert world.wait()
    losing[0] = True
    world.open(2)
    assert world.wait()
    assert world.step.resends >= 1
    assert world.resent == [["robot_0"]] * world.step.resends
    assert robot.heard[-1].tick == 2


@pytest.mark.usefixtures("hasty")
def test_inputs_are_sent_again_to_those_who_owe_an_answer(hub: MemoryHub, worlds: Worlds) -> None:
    """Who has answered is not named in what is sent again; everybody hears the tick once more."""
    world = worlds()
    first, last = make_team(hub, world, "robot_0", "robot_1")
    assert world.wait()
    last.awake = False
    world.open(3)
    before = len(first.heard)
    world.on_resend = last.answer
    assert world.wait()
    assert world.resent == [["robot_1"]]
    assert [tick.tick for tick in first.heard[before:]] == [3]


def test_repeats_become_seldom(hub: MemoryHub, worlds: Worlds, monkeypatch: pytest.MonkeyPatch) -> None:
    """The time between them doubles up to a limit, and begins anew with the next tick."""
    monkeypatch.setattr(lockstep, "RESEND", 0.02)
    monkeypatch.setattr(lockstep, "MAX_RESEND", 0.06)
    world = worlds()
    (robot,) = make_team(hub, world, "robot_0")
    assert world.wait()
    robot.awake = False
    for tick in (3, 4):
        times = [monotonic()]

        def note(times: list[float] = times) -> None:
            times.append(monotonic())
            world.on_resend = note if len(times) < 5 else robot.answer

        world.on_resend = note
        world.open(tick)
        assert world.wait()
        assert all(b - a >= least for (a, b), least in zip(pairwise(times), (0.019, 0.039, 0.059, 0.059), strict=True))
        assert times[1] - times[0] < LIMIT / 2
    assert world.step.resends == 10


@pytest.mark.usefixtures("hasty")
def test_who_is_silent_is_named_and_left_behind(hub: MemoryHub, worlds: Worlds) -> None:
    """A living participant that does not answer holds the world for the time-out; the others then go on without it."""
    world = worlds(timeout=50 * SHORT)
    robot, silent = make_team(hub, world, "robot_0", "robot_1")
    assert world.wait()
    silent.awake = False
    with listening() as log:
        world.open(3)
        assert world.wait()
    assert log.count("tick 3 waits for robot_1 for") == 1
    assert log.count("robot_1 did not answer tick 3") == 1
    assert world.step.hung == ["robot_1"]
    assert robot.lists[-1] == ["robot_0"]
    assert robot.heard[-1].tick == 3


@pytest.mark.usefixtures("hasty")
def test_who_was_left_behind_comes_back_at_the_next_tick(hub: MemoryHub, worlds: Worlds) -> None:
    """Its first word, were it the late answer itself, asks to be let in; it is listed from the next tick on."""
    world = worlds(timeout=2 * SHORT)
    robot, silent = make_team(hub, world, "robot_0", "robot_1")
    assert world.wait()
    silent.awake = silent.asks = False
    world.open(3)
    assert world.wait()
    world.open(4)
    assert world.wait()
    assert robot.lists[-1] == ["robot_0"]
    silent.say(Done(0, 3))
    assert world.step.joining == ["robot_1"]
    silent.awake = True
    world.open(5)
    assert world.wait()
    assert world.step.participants == ["robot_0", "robot_1"]
    assert world.step.hung == ["robot_1"]


@pytest.mark.usefixtures("hasty")
def test_the_aggregator_alone_is_to_blame_when_robots_wait_for_it(hub: MemoryHub, worlds: Worlds) -> None:
    """Without transforms the robots cannot answer either: they stay, and are told that it is out."""
    world = worlds(timeout=5 * SHORT)
    robot, aggregator = make_team(hub, world, "robot_0", "tf")
    assert world.wait()
    aggregator.awake = aggregator.asks = False
    robot.blocked_by = "tf"
    world.open(3)
    assert world.wait()
    assert robot.lists[-1] == ["robot_0"]
    assert world.step.hung == ["tf"]
    assert world.step.participants == ["robot_0"]


@pytest.mark.usefixtures("hasty")
def test_a_second_one_has_the_whole_time_out_for_itself(hub: MemoryHub, worlds: Worlds) -> None:
    """When the aggregator is left behind the robots' time begins anew."""
    timeout = 10 * SHORT
    world = worlds(timeout=timeout)
    robot, aggregator = make_team(hub, world, "robot_0", "tf")
    assert world.wait()
    aggregator.awake = aggregator.asks = robot.awake = robot.asks = False
    begin = monotonic()
    world.open(3)
    assert world.wait()
    assert monotonic() - begin >= 2 * timeout
    assert world.step.hung == ["tf", "robot_0"]
