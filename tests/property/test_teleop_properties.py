"""The pilot under any keys at any times: it moves one robot at most, and only shortly after a key that means so."""

from hypothesis import given
from hypothesis import strategies as st

from zteam.messages import Twist
from zteam.robot.teleop import (
    DIRECTIONS,
    FIRST,
    FOCUS_GAINED,
    FOCUS_LOST,
    HELP,
    MAX_SPEED,
    NEXT,
    OTHER,
    REPEAT,
    SPEED_FACTORS,
    KeyDecoder,
    Pilot,
)

KEYS = st.sampled_from([*DIRECTIONS, *SPEED_FACTORS, "k", "y", NEXT, HELP, OTHER, FOCUS_LOST, FOCUS_GAINED])
PAUSES = st.sampled_from([0.0, 0.03, 0.1, 0.29, 0.31, 0.5, 0.74, 0.76, 2.0])
PRESSES = st.lists(st.tuples(PAUSES, st.one_of(st.just("i"), KEYS)), max_size=40)


class Wish:
    """What the keys ask for, told from all presses so far by the words of the documentation."""

    def __init__(self) -> None:
        self.presses: list[tuple[float, str]] = []

    def key(self, now: float) -> str:
        """The key that counts; empty for none."""
        held, end = "", 0.0
        for moment, key in self.presses:
            if key in SPEED_FACTORS or key in (HELP, FOCUS_GAINED):
                continue
            if key not in DIRECTIONS:
                held = ""
            elif key == held and moment < end:
                end = max(end, moment + REPEAT)
            else:
                held, end = key, moment + FIRST
        return held if now < end else ""


@given(steps=PRESSES, after=PAUSES)
def test_a_robot_moves_only_while_its_key_counts(steps: list[tuple[float, str]], after: float) -> None:
    """The command is that of the newest key while it counts and zero otherwise, and never beyond the bounds."""
    pilot, wish, now = Pilot((0, 1, 2), 0.5, 1.0), Wish(), 100.0
    for pause, key in [*steps, (after, HELP)]:
        now += pause
        pilot.press(key, now)
        wish.presses.append((now, key))
        command, counts = pilot.command(now), wish.key(now)
        assert (command != Twist()) == bool(counts)
        if counts:
            forward, left, turn = DIRECTIONS[counts]
            got = command.linear.x, command.linear.y, command.angular.z
            assert got == (forward * pilot.speed, left * pilot.speed, turn * pilot.turn)
        assert max(map(abs, (command.linear.x, command.linear.y, command.angular.z))) <= MAX_SPEED


@given(steps=PRESSES)
def test_all_robots_but_one_stand(steps: list[tuple[float, str]]) -> None:
    """After all commands of a moment only the robot of the keys may move; at the end none does."""
    pilot, now = Pilot((4, 7, 9), 0.5, 1.0), 0.0
    newest: dict[int, Twist] = {}
    for pause, key in steps:
        now += pause
        pilot.press(key, now)
        newest.update(pilot.take_commands(now))
        assert {robot_id for robot_id, command in newest.items() if command != Twist()} <= {pilot.robot_id}
    pilot.let_go()
    newest.update(pilot.take_commands(now))
    assert all(command == Twist() for command in newest.values())


@given(parts=st.lists(st.one_of(st.binary(max_size=6), st.sampled_from([b"\x1b[A", b"\x1b[O", b"\x1b", b"[", b"i"]))))
def test_the_split_of_the_bytes_does_not_matter(parts: list[bytes]) -> None:
    """Any bytes give the same keys however they are cut, and at most one key is left over."""
    decoder = KeyDecoder()
    keys = [key for part in parts for key in decoder.feed(part)]
    whole = KeyDecoder()
    assert keys == whole.feed(b"".join(parts))
    assert decoder.flush() == whole.flush()
    assert decoder.flush() == []
