"""In which thread, and in which order, the handlers of a team in one process are called."""

import threading
from collections.abc import Iterator

import pytest

from support.limits import LIMIT
from zteam.bus import Publisher
from zteam.messages import Bool, Float64
from zteam.node.working import WORK, working_for
from zteam.team.in_process.bridge import NodeSessions


@pytest.fixture
def team_hub() -> Iterator[NodeSessions]:
    """The hub of a team without nodes."""
    hub = NodeSessions()
    yield hub
    hub.close()


def test_the_simulators_thread_calls_handlers_itself(team_hub: NodeSessions) -> None:
    """What the thread puts that delivers directly has been handled in it when `put` returns."""
    threads: list[threading.Thread] = []
    team_hub.bus("robot_0").subscribe("a", Bool, lambda _key, _message: threads.append(threading.current_thread()))
    team_hub.delivery.deliver_in_this_thread()
    team_hub.bus("sim").publisher("a", Bool).put(Bool(True))
    assert threads == [threading.current_thread()]


def test_other_threads_do_not_wait_for_a_receiver(team_hub: NodeSessions) -> None:
    """Two threads that hold the locks of two nodes and send to each other's handlers both go on."""
    locks = {name: threading.RLock() for name in ("robot_0", "robot_1")}
    heard: dict[str, threading.Event] = {name: threading.Event() for name in locks}
    meeting = threading.Barrier(2)

    def take(name: str) -> None:
        with locks[name]:
            heard[name].set()

    def send(own: str, other: str) -> None:
        publisher = team_hub.bus(own).publisher(f"{other}/in", Bool)
        with locks[own]:
            meeting.wait(LIMIT)
            publisher.put(Bool(True))

    for name in locks:
        team_hub.bus(name).subscribe(f"{name}/in", Bool, lambda key, _: take(key.partition("/")[0]))
    threads = [
        threading.Thread(target=send, args=pair, daemon=True)
        for pair in (("robot_0", "robot_1"), ("robot_1", "robot_0"))
    ]
    for thread in threads:
        thread.start()
    assert all(event.wait(LIMIT) for event in heard.values())
    for thread in threads:
        thread.join(LIMIT)
        assert not thread.is_alive()


def test_a_message_does_not_overtake_an_earlier_one(team_hub: NodeSessions) -> None:
    """What the simulator's thread puts is handled after a message that waits for its handler."""
    begun, go_on, done = threading.Event(), threading.Event(), threading.Event()
    heard: list[float] = []

    def take(_key: str, message: Float64) -> None:
        if not heard:
            begun.set()
            assert go_on.wait(LIMIT)
        heard.append(message.data)
        if len(heard) == 3:
            done.set()

    team_hub.bus("monitor").subscribe("a", Float64, take)
    publisher = team_hub.bus("robot_0").publisher("a", Float64)
    publisher.put(Float64(1.0))
    assert begun.wait(LIMIT)
    publisher.put(Float64(2.0))
    team_hub.delivery.deliver_in_this_thread()
    publisher.put(Float64(3.0))
    go_on.set()
    assert done.wait(LIMIT)
    assert heard == [1.0, 2.0, 3.0]


@pytest.mark.parametrize("first", ["robot_0", "robot_1"])
@pytest.mark.parametrize("in_simulators_thread", [True, False])
def test_an_answer_comes_after_what_it_answers(team_hub: NodeSessions, first: str, in_simulators_thread: bool) -> None:
    """A node gets the answer of another one after the message itself, whichever of them gets that first."""
    heard, done = dict[str, list[str]](), threading.Event()
    for name in sorted(("robot_0", "robot_1"), key=lambda name: name != first):
        bus = team_hub.bus(name)
        answers, mine = bus.publisher("answer", Bool), heard.setdefault(name, [])

        def take(key: str, _: Bool, mine: list[str] = mine, answers: Publisher[Bool] = answers) -> None:
            mine.append(key)
            if key == "tick":
                answers.put(Bool(True))
            if all(len(keys) == 3 for keys in heard.values()):
                done.set()

        bus.subscribe("*", Bool, take)
    if in_simulators_thread:
        team_hub.delivery.deliver_in_this_thread()
    team_hub.bus("sim").publisher("tick", Bool).put(Bool(True))
    assert done.wait(LIMIT)
    assert heard == {name: ["tick", "answer", "answer"] for name in ("robot_0", "robot_1")}


def test_a_token_comes_after_what_was_put_before(team_hub: NodeSessions) -> None:
    """The end of a robot's token is told after its last command, which counts for the same tick."""
    told: list[str] = []
    done = threading.Event()

    def on_token(_key: str, alive: bool) -> None:
        told.append("comes" if alive else "goes")
        if not alive:
            done.set()

    simulator, robot = team_hub.bus("sim"), team_hub.bus("robot_0")
    simulator.subscribe("robot_0/cmd_vel", Bool, lambda _key, _message: told.append("command"))
    simulator.watch_tokens(["robot_0/alive/*"], on_token)
    token = robot.declare_token("robot_0/alive/1")
    robot.publisher("robot_0/cmd_vel", Bool).put(Bool(True))
    token.close()
    assert done.wait(LIMIT)
    assert told == ["comes", "command", "goes"]


def test_an_error_of_a_handler_ends_no_thread(team_hub: NodeSessions) -> None:
    """After a handler that raises even SystemExit, the next message is handled."""
    heard = threading.Event()

    def take(_key: str, message: Bool) -> None:
        if message.data:
            raise SystemExit(3)
        heard.set()

    team_hub.bus("robot_0").subscribe("a", Bool, take)
    publisher = team_hub.bus("sim").publisher("a", Bool)
    publisher.put(Bool(True))
    publisher.put(Bool(False))
    assert heard.wait(LIMIT)


def test_the_innermost_node_owns_what_it_does() -> None:
    """A node that is called by the code of another one is the owner; code of no node has none."""

    def owner() -> str:
        return WORK[threading.get_ident()].node

    assert owner() == ""
    with working_for("sim"):
        assert owner() == "sim"
        with working_for("robot_0"):
            assert owner() == "robot_0"
        assert owner() == "sim"
