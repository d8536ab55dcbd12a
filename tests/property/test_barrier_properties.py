"""The barrier under any order of tokens, answers, ticks and drops."""

from hypothesis import given
from hypothesis import strategies as st

from zteam.messages import Done, Twist, Vector3
from zteam.nodes.simulator.open_tick import Barrier

NAMES = st.sampled_from(["robot_0", "robot_1", "robot_10", "tf"])
EPOCHS, TICKS = st.integers(0, 1), st.integers(1, 3)
TOKENS = st.tuples(st.just("token"), NAMES, st.sampled_from("ab"), st.booleans())
ANSWERS = st.tuples(st.just("done"), NAMES, st.sampled_from("ab"), st.tuples(EPOCHS, TICKS))
OPENS = st.tuples(st.just("open"), st.just(""), EPOCHS, TICKS)
DROPS = st.tuples(st.just("drop"), NAMES, st.just(0), st.just(0))
STEPS = st.lists(st.one_of(TOKENS, ANSWERS, ANSWERS, OPENS, DROPS), max_size=80)


class BarrierModel:
    """The barrier in a few sets: what it should say after each step."""

    def __init__(self) -> None:
        self.holders: dict[str, set[str]] = {}
        self.members: set[str] = set()
        self.joining: set[str] = set()
        self.said: dict[str, float] = {}
        """The mark of each participant's newest answer to the open tick."""
        self.key = (0, 0)

    def leave(self, name: str) -> None:
        self.members.discard(name)
        self.joining.discard(name)


def play(barrier: Barrier, model: BarrierModel, step: tuple[str, str, object, object], mark: float) -> None:
    """Apply one step to both."""
    what, name, first, second = step
    if what == "token":
        instance, alive = str(first), bool(second)
        barrier.take_token(name, instance, alive)
        holders = model.holders.setdefault(name, set())
        (holders.add if alive else holders.discard)(instance)
        if not holders:
            model.leave(name)
    elif what == "done":
        session, key = str(first), second
        assert isinstance(key, tuple)
        taken = barrier.take_done(name, session, Done(*key, True, Twist(Vector3(mark))))
        assert taken == (session in model.holders.get(name, ()))
        if taken and name not in model.members:
            model.joining.add(name)
        elif taken and key == model.key:
            model.said[name] = mark
    elif what == "open":
        assert isinstance(first, int)
        assert isinstance(second, int)
        if (first, second) != model.key:
            model.key, model.said = (first, second), {}
        model.members |= model.joining
        model.joining = set()
        assert barrier.open(first, second) == barrier.members
    else:
        barrier.drop(name)
        model.leave(name)


@given(steps=STEPS, expected=st.sets(NAMES))
def test_the_barrier_waits_for_its_members_alone(
    steps: list[tuple[str, str, object, object]], expected: set[str]
) -> None:
    """It is complete if and only if every member answered the open tick; members are alive, sorted, and had joined."""
    barrier, model = Barrier(expected), BarrierModel()
    answered: set[str] = set()
    for mark, step in enumerate(steps, start=1):
        before = set(barrier.members)
        play(barrier, model, step, float(mark))
        if step[0] == "done":
            answered.add(step[1])
        assert barrier.members == sorted(model.members)
        assert len(barrier.members) == len(set(barrier.members))
        assert barrier.joining == model.joining
        assert not barrier.joining & set(barrier.members)
        assert {name: done.command.linear.x for name, done in barrier.answers.items()} == model.said
        assert barrier.missing() == [name for name in barrier.members if name not in model.said]
        assert barrier.complete == (model.members <= set(model.said))
        # A process becomes a member only when a tick is opened, and only with a token and an answer. It leaves at once.
        assert step[0] == "open" or set(barrier.members) <= before
        assert set(barrier.members) | barrier.joining <= answered
        assert all(model.holders[name] for name in {*barrier.members, *barrier.joining})
        assert all(barrier.holds(name, each) == (each in held) for name, held in model.holders.items() for each in "ab")
        assert barrier.absent == sorted(expected - set(barrier.members) - barrier.joining)


@given(steps=STEPS)
def test_answers_are_kept_exactly_while_the_tick_is_the_same(steps: list[tuple[str, str, object, object]]) -> None:
    """Opening the open tick again keeps all answers and admits the joining processes; another tick has no answers."""
    barrier, model = Barrier(), BarrierModel()
    for mark, step in enumerate(steps, start=1):
        play(barrier, model, step, float(mark))
        said, members, joining = dict(barrier.answers), set(barrier.members), set(barrier.joining)
        barrier.open(*model.key)
        assert barrier.answers == said
        assert set(barrier.members) == members | joining
        model.members, model.joining = members | joining, set()
        if mark % 7 == 0:
            barrier.open(9, 9)
            assert barrier.answers == {}
            model.key, model.said = (9, 9), {}
