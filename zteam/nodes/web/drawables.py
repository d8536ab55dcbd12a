"""Which keys carry something to draw, such as plans, costmaps and markers. Any process may publish them. Pure."""

from collections.abc import Collection, Iterable, Mapping

from zteam import names
from zteam.bus.topics import type_of_key
from zteam.messages import (
    Marker,
    MarkerArray,
    Message,
    OccupancyGrid,
    Path,
    PolygonStamped,
    PoseArray,
    type_of_encoding,
)
from zteam.nodes.web.subscriptions import Topic

LAYERS: Mapping[str, tuple[type[Message], ...]] = {
    "plans": (Path,),
    "costmaps": (OccupancyGrid,),
    "particles": (PoseArray,),
    "markers": (Marker, MarkerArray, PolygonStamped),
}
"""Message types by the layer that shows them."""
MAX_KEYS = 1024


class Drawables:
    """The keys that other processes publish, and their types as far as known."""

    def __init__(self) -> None:
        self._kinds: dict[str, type[Message] | None] = {}
        """None: not known yet, a first message will tell."""
        self._others: set[str] = set()
        """Keys whose messages are not drawn."""

    def take_keys(self, published: Iterable[str]) -> None:
        """These keys are published now."""
        keys = {key for key in published if not names.is_wildcard(key) and key != names.MAP}
        # Replaced as a whole: other threads read it meanwhile.
        kinds = {key: kind for key, kind in self._kinds.items() if key in keys}
        self._others &= keys
        for key in sorted(keys)[:MAX_KEYS]:
            if key not in kinds and key not in self._others:
                kind = type_of_key(key)
                if key.startswith("@") or (kind is not None and not _is_drawn(kind)):
                    self._others.add(key)
                else:
                    kinds[key] = kind
        self._kinds = kinds

    def unknown(self) -> list[str]:
        """The keys of unknown type."""
        return [key for key, kind in self._kinds.items() if kind is None]

    def learn(self, key: str, encoding: str) -> None:
        """A message of a key came, in this encoding."""
        if key in self._kinds and self._kinds[key] is None:
            kind = type_of_encoding(encoding)
            if kind is not None and _is_drawn(kind):
                self._kinds = {**self._kinds, key: kind}
            else:
                self._kinds = {other: kind for other, kind in self._kinds.items() if other != key}
                self._others.add(key)

    def keys(self, layer: str) -> list[str]:
        """The keys that a layer shows."""
        return sorted(key for key, kind in self._kinds.items() if kind in LAYERS[layer])

    def topics(self, layers: Collection[str]) -> set[Topic]:
        """What to subscribe to for these layers; a key of unknown type until its first message."""
        chosen = [kind for layer in layers for kind in LAYERS.get(layer, ())]
        if not chosen:
            return set()
        found = set()
        for key, kind in self._kinds.items():
            if kind is None:
                found.add(Topic(key, latched=True))
            elif kind in chosen:
                found.add(Topic(key, latched=True, every=kind in (Marker, MarkerArray)))
        return found


def _is_drawn(kind: type[Message]) -> bool:
    return any(kind in kinds for kinds in LAYERS.values())
