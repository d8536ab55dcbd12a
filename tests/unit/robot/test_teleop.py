"""Keys, scripts, and what they command."""

import pytest

from zteam.errors import UsageError
from zteam.messages import Twist, Vector3
from zteam.robot.teleop import (
    DIRECTIONS,
    FOCUS_GAINED,
    FOCUS_LOST,
    HELP,
    MAX_SPEED,
    MIN_SPEED,
    NEXT,
    OTHER,
    SPACE,
    KeyDecoder,
    Pilot,
    parse_script,
)

TELEOP_TWIST_KEYBOARD = {
    "i": (1, 0, 0), "o": (1, 0, -1), "j": (0, 0, 1), "l": (0, 0, -1), "u": (1, 0, 1), ",": (-1, 0, 0),
    ".": (-1, 0, 1), "m": (-1, 0, -1), "O": (1, -1, 0), "I": (1, 0, 0), "J": (0, 1, 0), "L": (0, -1, 0),
    "U": (1, 1, 0), "<": (-1, 0, 0), ">": (-1, -1, 0), "M": (-1, 1, 0),
}  # fmt: skip
"""x, y and turn of its table of moves."""


def test_the_keys_are_those_of_teleop_twist_keyboard() -> None:
    """Each of its keys in the plane means the same; the arrows are i, comma, j and l."""
    arrows = {"up": "i", "down": ",", "left": "j", "right": "l"}
    expected = {**TELEOP_TWIST_KEYBOARD, **{arrow: TELEOP_TWIST_KEYBOARD[key] for arrow, key in arrows.items()}}
    assert dict(DIRECTIONS) == expected


@pytest.mark.parametrize(
    ("data", "keys"),
    [
        (b"iI,", ["i", "I", ","]),
        (b"\t \x1b[A", [NEXT, SPACE, "up"]),
        (b"\x1b[B\x1bOC\x1b[D", ["down", "right", "left"]),
        (b"\x1b[O\x1b[I", [FOCUS_LOST, FOCUS_GAINED]),
        (b"\x1b[15~\x1b[1;2A\x1bOPi", [OTHER, OTHER, OTHER, "i"]),
        (b"\x1bi", [OTHER]),
        ("é".encode(), ["é"]),
        (b"\xff", ["\ufffd"]),
    ],
)
def test_bytes_become_keys(data: bytes, keys: list[str]) -> None:
    """Plain keys, arrows in both modes of a terminal, its focus, and sequences without a meaning."""
    assert KeyDecoder().feed(data) == keys


def test_a_sequence_may_come_in_parts() -> None:
    """A loss of the focus that comes byte by byte is one key, not three."""
    decoder = KeyDecoder()
    assert [decoder.feed(bytes([byte])) for byte in b"\x1b[Oi"] == [[], [], [FOCUS_LOST], ["i"]]


def test_escape_alone_is_a_key() -> None:
    """Esc has no meaning, so it stops; it does not swallow the next key."""
    decoder = KeyDecoder()
    assert decoder.feed(b"\x1b") == []
    assert decoder.flush() == [OTHER]
    assert decoder.flush() == []
    assert decoder.feed(b"i") == ["i"]


STILL = Twist()
AHEAD = Twist(Vector3(0.5))


def make_pilot(*robot_ids: int) -> Pilot:
    """With the speeds of teleop_twist_keyboard."""
    return Pilot(robot_ids or (0,), 0.5, 1.0)


def test_nothing_is_commanded_before_the_first_key() -> None:
    """A look at a robot does not take it from its behaviour; nor do the focus, the help or a change of speed."""
    pilot = make_pilot(3)
    for key in (FOCUS_LOST, FOCUS_GAINED, HELP, "q"):
        pilot.press(key, 1.0)
        assert pilot.take_commands(1.0) == []
    pilot.press("k", 2.0)
    assert pilot.take_commands(2.0) == [(3, STILL)]


def test_a_key_that_is_held_down_is_pressed_once() -> None:
    """Its repeats do not take the robot back from another teleop; a stop does each time, and what commands nothing
    never."""
    pilot = make_pilot()
    pressed = [pilot.press("i", now) for now in (1.0, 1.5, 1.6)]
    assert [*pressed, pilot.press("j", 1.7), pilot.press("j", 9.0)] == [True, False, False, True, True]
    assert [pilot.press(key, 10.0) for key in ("k", "k", SPACE)] == [True] * 3
    assert not any(pilot.press(key, 11.0) for key in (FOCUS_LOST, FOCUS_GAINED, HELP, "q", NEXT))


@pytest.mark.parametrize(
    ("key_timeout", "presses", "stands"),
    [
        (None, [0.0, 0.33, 0.66], [0.97]),
        (0.5, [0.0, 0.33, 0.66, 0.99, 1.32], [1.83]),
        (2.0, [0.0], [2.01]),
        (2.0, [0.0, 0.5], [2.51]),
        (0.2, [0.0], [0.21]),
    ],
)
def test_a_key_counts_as_long_as_the_user_says(
    key_timeout: float | None, presses: list[float], stands: list[float]
) -> None:
    """From each press and each repeat on: one that repeats three times a second, or not at all, drives evenly."""
    pilot, moving = Pilot((0,), 0.5, 1.0, key_timeout), []
    for moment in presses:
        moving.append(pilot.command(moment - 0.01) == AHEAD)
        pilot.press("i", moment)
    assert moving == [False] + [True] * (len(presses) - 1)
    assert [pilot.command(moment - 0.02) for moment in stands] == [AHEAD]
    assert [pilot.command(moment) for moment in stands] == [STILL]


def test_speed_keys_change_the_motion_under_way() -> None:
    """q makes both 10 % faster, x and c slower, within bounds; the key that drives goes on to count."""
    pilot = make_pilot()
    pilot.press("u", 0.0)
    pilot.press("q", 0.1)
    command = pilot.command(0.2)
    assert (command.linear.x, command.angular.z) == pytest.approx((0.55, 1.1))
    for _ in range(200):
        pilot.press("w", 0.2)
        pilot.press("c", 0.2)
    assert (pilot.speed, pilot.turn) == (MAX_SPEED, MIN_SPEED)


def test_tab_stops_the_robot_that_is_left() -> None:
    """It gets one zero and no more; the next is not commanded before its first key; after the last comes the first."""
    pilot = make_pilot(0, 1)
    pilot.press("i", 0.0)
    pilot.press(NEXT, 0.1)
    assert pilot.take_commands(0.1) == [(0, STILL)]
    assert pilot.take_commands(0.2) == []
    pilot.press("i", 0.3)
    assert pilot.take_commands(0.3) == [(1, AHEAD)]
    pilot.press(NEXT, 0.4)
    assert pilot.take_commands(0.4) == [(1, STILL)]
    assert pilot.robot_id == 0


def test_words_are_presses() -> None:
    """A key, a key with a count, and names of keys that are no character."""
    assert parse_script("i*3 l*2 k") == ["i", "i", "i", "l", "l", "k"]
    assert parse_script(" up*2\n,  tab space > q ") == ["up", "up", ",", "tab", "space", ">", "q"]


@pytest.mark.parametrize(
    "text", ["", " ", "y", "i*0", "i*-1", "i*", "*3", "i**2", "i*1.5", "i*٣", "ii", "i*9999999", "?"]
)
def test_bad_scripts_are_refused(text: str) -> None:
    """One line that names the option, and the word if there is one."""
    with pytest.raises(UsageError) as caught:
        parse_script(text)
    assert str(caught.value).startswith("--script: ")
    assert "\n" not in str(caught.value)
    assert not text.strip() or repr(text.strip()) in str(caught.value)
