"""zteam: a team of robots as separate processes linked by Zenoh."""

from __future__ import annotations

from zteam.version import __version__

# Not typing's own: a command is deaf to Ctrl+C until what stands here is imported.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

    from zteam.runtime.step_node import Node, run

__all__ = ["Node", "__version__", "run"]


def __getattr__(name: str) -> Any:
    # Lazy: whoever wants only the simulator or the transforms does not pay for the bus.
    if name not in ("Node", "run"):
        raise AttributeError(f"module 'zteam' has no attribute {name!r}")
    from zteam.runtime import step_node

    return getattr(step_node, name)
