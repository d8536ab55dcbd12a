"""The conflicts between sources of transforms: each one is recorded once, however often it happens."""

MAX_CONFLICTS = 1000
"""Conflicts that are recorded; later ones are dropped, so that a faulty robot cannot fill the memory."""


class Conflicts:
    """The texts of the refused transforms, one for each child frame, authority and code."""

    def __init__(self) -> None:
        self._texts: dict[tuple[str, str, str], str] = {}
        self._unread: list[str] = []

    def report(self, child: str, authority: str, code: str, text: str) -> None:
        """Record that `child` from `authority` was refused; a repetition of the same conflict is ignored."""
        key = (child, authority, code)
        if key not in self._texts and len(self._texts) < MAX_CONFLICTS:
            self._texts[key] = text
            self._unread.append(text)

    def all(self) -> list[str]:
        """Every recorded conflict, oldest first."""
        return list(self._texts.values())

    def take_unread(self) -> list[str]:
        """The conflicts recorded since the last call."""
        found, self._unread = self._unread, []
        return found
