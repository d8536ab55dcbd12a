"""How long a test waits for what must come: many times what it takes, so that only a fault reaches it."""

from zteam.clock import HOST_FACTOR

LIMIT = 60.0 * HOST_FACTOR
"""Host seconds for anything that a condition tells: the start of a process, an answer, the end of a thread."""
ASKED = min(LIMIT, 60.0)
"""Host seconds for an answer that the asked process itself waits for: it refuses to wait longer than a minute."""
