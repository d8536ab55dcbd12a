"""Teleoperation: robots driven with the keys of a terminal. The caller passes the time in seconds of any clock."""

import codecs
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

from zteam.errors import UsageError
from zteam.messages import Twist, Vector3

if TYPE_CHECKING:
    from zteam.robot.wheels import Wheels


DIRECTIONS = {
    "u": (1, 0, 1), "i": (1, 0, 0), "o": (1, 0, -1),
    "j": (0, 0, 1), "l": (0, 0, -1),
    "m": (-1, 0, -1), ",": (-1, 0, 0), ".": (-1, 0, 1),
    "U": (1, 1, 0), "I": (1, 0, 0), "O": (1, -1, 0),
    "J": (0, 1, 0), "L": (0, -1, 0),
    "M": (-1, 1, 0), "<": (-1, 0, 0), ">": (-1, -1, 0),
    "up": (1, 0, 0), "down": (-1, 0, 0), "left": (0, 0, 1), "right": (0, 0, -1),
}  # fmt: skip
"""By key: shares of the speed forwards and to the left, and of the turn rate to the left."""
SPEED_FACTORS = {"q": (1.1, 1.1), "z": (0.9, 0.9), "w": (1.1, 1.0), "x": (0.9, 1.0), "e": (1.0, 1.1), "c": (1.0, 0.9)}
"""By what a key multiplies speed and turn rate."""
STOP, SPACE, NEXT, HELP = "k", "space", "tab", "?"
FOCUS_LOST, FOCUS_GAINED = "focus lost", "focus gained"
OTHER = "other"
"""Any sequence without a meaning here, such as that of a function key."""

HELP_TEXT = """\
u i o   forwards, with a turn to the left or right (up: i)
j   l   turn (left, right)
m , .   backwards, with a turn (down: ,)
With shift, for omnidirectional bases: J L sideways, U O M > at an angle, I < straight.
q z     both speeds 10 % up, down; w x: only the speed; e c: only the turn rate
k, space, any other key: stop    tab: stop, let go, next robot    ?: this help    Ctrl+C: stop and end
A key counts for a moment after each press and repeat (--key-timeout), then the robot stands."""

_NAMES = {"\t": NEXT, " ": SPACE}
_SEQUENCES = {
    **{start + end: key for start in "[O" for end, key in {"A": "up", "B": "down", "C": "right", "D": "left"}.items()},
    "[I": FOCUS_GAINED,
    "[O": FOCUS_LOST,
}
_KEY = re.compile(r"\x1b(?P<sequence>\[[0-?]*[ -/]*[@-~]|O.|[^\[O])|(?P<plain>[^\x1b])", re.DOTALL)


class KeyDecoder:
    """Makes keys of what a terminal sends; a sequence may come in parts."""

    def __init__(self) -> None:
        self._characters = codecs.getincrementaldecoder("utf-8")("replace")
        self._rest = ""

    def feed(self, data: bytes) -> list[str]:
        """The keys that are whole now."""
        text = self._rest + self._characters.decode(data)
        keys, end = [], 0
        while found := _KEY.match(text, end):
            end = found.end()
            plain = found["plain"]
            keys.append(_NAMES.get(plain, plain) if plain else _SEQUENCES.get(found["sequence"], OTHER))
        self._rest = text[end:]
        return keys

    def flush(self) -> list[str]:
        """Nothing more has come for a while: a sequence that has only begun was a key, such as Esc."""
        begun, self._rest = self._rest, ""
        return [OTHER] if begun else []


FIRST = 0.75
"""Seconds that a key counts after its first press: a terminal tells no release, and repeats begin after 0.5 s."""
REPEAT = 0.3
"""Seconds that a key counts after each repeat."""
MIN_SPEED, MAX_SPEED = 0.01, 10.0
"""Bounds of speed (m/s) and turn rate (rad/s), however often their keys are pressed."""


class Pilot:
    """Drives one robot of several: from its first key on, at zero velocity while no key counts, until `tab`."""

    def __init__(self, robot_ids: Sequence[int], speed: float, turn: float, key_timeout: float | None = None) -> None:
        """A key counts for `key_timeout` seconds after each press and repeat; None: for FIRST, then for REPEAT."""
        self._first, self._repeat = key_timeout or FIRST, key_timeout or REPEAT
        self.robot_ids = tuple(robot_ids)
        self.robot_id = self.robot_ids[0]
        """The robot that the keys drive."""
        self.speed, self.turn = speed, turn
        self.holds = False
        """Whether the robot is commanded."""
        self._left: list[int] = []
        """Robots that are to be stopped, because the pilot has let go of them."""
        self._key = ""
        self._until = 0.0

    def press(self, key: str, now: float) -> bool:
        """Take a key, its repeat, or a change of the focus. A key without a meaning stops.

        Returns whether the key, and not the repeat of one that is held down, commands the robot.
        """
        if key in SPEED_FACTORS:
            speeds = zip((self.speed, self.turn), SPEED_FACTORS[key], strict=True)
            self.speed, self.turn = (min(max(speed * by, MIN_SPEED), MAX_SPEED) for speed, by in speeds)
        elif key == NEXT:
            self.let_go()
            self.robot_id = self.robot_ids[(self.robot_ids.index(self.robot_id) + 1) % len(self.robot_ids)]
        elif key == FOCUS_LOST:
            self._key = ""
        elif key in DIRECTIONS:
            repeated = key == self._key and now < self._until
            self._until = max(self._until, now + self._repeat) if repeated else now + self._first
            self._key, self.holds = key, True
            return not repeated
        elif key not in (FOCUS_GAINED, HELP):
            self._key, self.holds = "", True
            return True
        return False

    def let_go(self) -> None:
        """Stop the robot and command it no more."""
        if self.holds:
            self._left.append(self.robot_id)
        self._key, self.holds = "", False

    def command(self, now: float) -> Twist:
        if not self._key or now >= self._until:
            return Twist()
        forward, left, turn = DIRECTIONS[self._key]
        return Twist(Vector3(forward * self.speed, left * self.speed), Vector3(z=turn * self.turn))

    def take_commands(self, now: float) -> list[tuple[int, Twist]]:
        """What to send now, in this order: robot id and command."""
        commands = [(robot_id, Twist()) for robot_id in self._left]
        self._left.clear()
        if self.holds:
            commands.append((self.robot_id, self.command(now)))
        return commands


PERIOD = 0.1
"""Seconds from one press to the next."""
_KEYS = (*DIRECTIONS, *SPEED_FACTORS, STOP, SPACE, NEXT)
_WORD = re.compile(r"(?P<key>[^*\s]+)(?:\*(?P<count>[1-9][0-9]{0,5}))?", re.ASCII)


def parse_script(text: str) -> list[str]:
    """The keys in their order. Raises UsageError that names the word."""
    presses: list[str] = []
    for word in text.split():
        found = _WORD.fullmatch(word)
        if found is None or found["key"] not in _KEYS:
            raise UsageError(f"--script: {word[:20]!r}: give keys such as i, i*10 or up*10; keys: {' '.join(_KEYS)}")
        presses += [found["key"]] * int(found["count"] or "1")
    if not presses:
        raise UsageError("--script: no key is given: give keys such as 'i*10 l*5 k'")
    return presses


Presses = Iterable[tuple[list[str], float]]
"""Keys, and the time in seconds at which commands are due; without keys as often as commands are to be sent."""


def drive(pilot: Pilot, wheels: Mapping[int, "Wheels"], presses: Presses, show: Callable[[], None]) -> None:
    """Drive until the presses end; `show()` is called after each of them."""

    def send(now: float) -> None:
        for robot_id, command in pilot.take_commands(now):
            wheels[robot_id].drive(command)

    now = 0.0
    try:
        for keys, now in presses:
            for key in keys:
                if pilot.press(key, now):
                    wheels[pilot.robot_id].press()
            send(now)
            show()
    finally:
        pilot.let_go()
        send(now)
