"""Which processes publish and subscribe to which key, and the keys near a mistyped one."""

import difflib
from collections.abc import Collection, Iterable, Sequence

from zteam import names
from zteam.bus import Bus
from zteam.bus.presence import ProcessInfo, holder_text, names_of_sessions
from zteam.bus.transport import Declaration, matches
from zteam.errors import BusError

_PATIENCE = 0.5
"""Host seconds for processes to tell their names; one that hangs is shown by its session."""


class KeyUsers:
    """The publishers and subscribers of all sessions of zteam but the tool's own, by the names of their processes."""

    def __init__(self, declarations: Sequence[Declaration], processes: Sequence[ProcessInfo]) -> None:
        """`processes` are those of zteam; one may be there with several names."""
        self._declarations = declarations
        self._processes = processes

    def publishers(self, key_expr: str) -> list[str]:
        """The processes that publish on keys of `key_expr`."""
        return self._names(key_expr, publishes=True)

    def subscribers(self, key_expr: str) -> list[str]:
        """The processes that subscribe to keys of `key_expr`."""
        return self._names(key_expr, publishes=False)

    def _names(self, key_expr: str, *, publishes: bool) -> list[str]:
        sessions = {d.session for d in self._declarations if d.publishes == publishes and matches(d.key, key_expr)}
        return self.name_sessions(sessions, key_expr)

    def name_sessions(self, sessions: Iterable[str], key: str) -> list[str]:
        """The users of a key by name, sorted; one that is no process of zteam by its session's id."""
        known = names_of_sessions(self._processes, key)
        return sorted(holder_text(known.get(session), session) for session in sessions)

    def known_keys(self, heard: Iterable[str] = ()) -> list[str]:
        """Every key with a publisher or a subscriber. A wildcard is a key of each robot here and in `heard`."""
        robots = self.robots(heard)
        return sorted({key for d in self._declarations for key in names.keys_in(d.key, robots)})

    def robots(self, heard: Iterable[str] = ()) -> list[int]:
        """The ids of the robots that have a key of their own, declared or `heard`."""
        keys = (*(declaration.key for declaration in self._declarations), *heard)
        return sorted({target[0] for target in map(names.split_robot_key, keys) if target is not None})


def find_key_users(bus: Bus) -> KeyUsers:
    """The users of all keys now."""
    declarations = bus.declarations()
    try:
        infos = bus.query(names.info_key("*"), ProcessInfo, timeout=_PATIENCE)
    except BusError:
        infos = []
    return KeyUsers(declarations, [info for _, info in infos])


NO_KEYS = "no key has a publisher or a subscriber (is a simulator running? see 'zteam doctor')"


def near_keys(key: str, known: Collection[str]) -> str:
    """`: did you mean X or Y?`: the keys, or frames, that may be meant by `key`, the nearest first; else nothing.

    They end or begin with `key`, are spelt like it, or have a longer last part, as `robot_0/base_scan` for `scan`.
    """
    ordered = sorted(known)
    near = (
        [other for other in ordered if other.endswith(f"/{key}")]
        or [other for other in ordered if other.startswith(f"{key}/")]
        or _most_alike(key, ordered)
        or [other for other in ordered if other.endswith(f"_{key}")]
    )
    return f": did you mean {' or '.join(near[:3])}?" if near else ""


def _most_alike(key: str, known: Sequence[str]) -> list[str]:
    near = difflib.get_close_matches(key, known, n=3, cutoff=0.8)
    return sorted(near, key=lambda other: (-difflib.SequenceMatcher(None, other, key).ratio(), other))


def where_to_look(key: str, known: Collection[str]) -> str:
    """The end of a sentence about a `key` without users: the `known` keys that may be meant, else what to do."""
    return near_keys(key, known) or (": see 'zteam topic list'" if known else f": {NO_KEYS}")
