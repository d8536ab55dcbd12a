"""The open tick under any order of tokens, answers, ticks and drops."""

from collections.abc import Collection

from hypothesis import given
from hypothesis import strategies as st

from zteam.messages import Done, Twist, Vector3
from zteam.simulator.process.open_tick import OpenTick

NAMES = st.sampled_from(["robot_0", "robot_1", "robot_10", "tf"])
EPOCHS, TICKS = st.integers(0, 1), st.integers(1, 3)
TOKENS = st.tuples(st.just("token"), NAMES, st.sampled_from("ab"), st.booleans())
ANSWERS = st.tuples(st.just("done"), NAMES, st.sampled_from("ab"), st.tuples(EPOCHS, TICKS))
OPENS = st.tuples(st.just("open"), st.just(""), EPOCHS, TICKS)
DROPS = st.tuples(st.just("drop"), NAMES, st.just(0), st.just(0))
STEPS = st.lists(st.one_of(TOKENS, ANSWERS, ANSWERS, OPENS, DROPS), max_size=80)


class TickModel:
    """The open tick in a few sets: what it should say after each step."""

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


def free_tick(expected: Collection[str]) -> OpenTick:
    """Without a gate, and not held."""
    tick = OpenTick(expected, gate=False)
    tick.end()
    return tick


def play(tick: OpenTick, model: TickModel, step: tuple[str, str, object, object], mark: float) -> None:
    """Apply one step to both."""
    what, name, first, second = step
    if what == "token":
        instance, alive = str(first), bool(second)
        tick.on_token(name, instance, alive)
        holders = model.holders.setdefault(name, set())
        (holders.add if alive else holders.discard)(instance)
        if not holders:
            model.leave(name)
    elif what == "done":
        session, key = str(first), second
        assert isinstance(key, tuple)
        taken = tick.on_done(name, session, Done(*key, True, Twist(Vector3(mark))))
        assert taken == (session in model.holders.get(name, ()))
        if taken and name not in model.members:
            model.joining.add(name)
        elif taken and key == model.key:
            model.said[name] = mark
    elif what == "open":
        assert isinstance(first, int)
        assert isinstance(second, int)
        tick.on_go(first)
        key = max(first, model.key[0]), second
        if key != model.key:
            model.key, model.said = key, {}
        model.members |= model.joining
        model.joining = set()
        assert tick.open(0, second, []).participants == tick.members
    else:
        tick.drop_silent([name])
        model.leave(name)


@given(steps=STEPS, expected=st.sets(NAMES))
def test_a_tick_waits_for_its_members_alone(steps: list[tuple[str, str, object, object]], expected: set[str]) -> None:
    """It is complete if and only if every member answered the open tick; members are alive, sorted, and had joined."""
    tick, model = free_tick(expected), TickModel()
    answered: set[str] = set()
    for mark, step in enumerate(steps, start=1):
        before, listed = set(tick.members), tick.members
        play(tick, model, step, float(mark))
        # A tick that was sent holds the list.
        assert set(listed) == before
        if step[0] == "done":
            answered.add(step[1])
        assert tick.members == sorted(model.members)
        assert len(tick.members) == len(set(tick.members))
        assert tick.joining == model.joining
        assert not tick.joining & set(tick.members)
        assert {name: done.command.linear.x for name, done in tick.answers.items()} == model.said
        assert tick.missing() == [name for name in tick.members if name not in model.said]
        assert (not tick.missing()) == (model.members <= set(model.said))
        # A process becomes a member only when a tick is opened, and only with a token and an answer. It leaves at once.
        assert step[0] == "open" or set(tick.members) <= before
        assert set(tick.members) | tick.joining <= answered
        assert all(model.holders[name] for name in {*tick.members, *tick.joining})
        assert all(
            (each in tick.holders.instances(name)) == (each in held)
            for name, held in model.holders.items()
            for each in "ab"
        )
        assert tick.absent == sorted(expected - set(tick.members) - tick.joining)
