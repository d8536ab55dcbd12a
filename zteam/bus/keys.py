"""Whether a text is a key expression, by Zenoh's own rules."""

import zenoh


def problem_of(key: str) -> str:
    """What is wrong with a key expression; empty if nothing is."""
    try:
        zenoh.KeyExpr(key)
    except zenoh.ZError as error:
        return str(error).partition(" at ")[0].splitlines()[0]
    return ""
