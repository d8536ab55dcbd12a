"""Key expressions, by Zenoh's own rules."""

import zenoh

from zteam.errors import BusError


def first_line(error: zenoh.ZError) -> str:
    """What an error of Zenoh says, without the place in Zenoh's source."""
    return (str(error).splitlines() or ["unknown"])[0].partition(" at /")[0]


def problem_of(key: str) -> str:
    """What is wrong with a key expression; empty if nothing is."""
    try:
        zenoh.KeyExpr(key)
    except zenoh.ZError as error:
        return first_line(error)
    return ""


def matches(key_expr: str, other: str) -> bool:
    """Whether some key is in both key expressions."""
    return bool(zenoh.KeyExpr(key_expr).intersects(zenoh.KeyExpr(other)))


def check_use(action: str, key: str, closed: bool) -> None:
    """Raise BusError if the session is closed or `key` is no key expression; `action` is a verb, such as "ask"."""
    problem = "the session is closed" if closed else problem_of(key)
    if problem:
        raise BusError(f"cannot {action} {key}: {problem}")
