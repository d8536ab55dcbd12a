"""Presence tokens that vanished, held back until it is clear whether the process ended or the router.

When the router goes, all tokens vanish within milliseconds of the link, before or after it; when it is back they
come back one by one, as their processes find it again. Only a token that stays away with the link up is a loss.
"""

GRACE = 0.25
"""Host seconds that a vanished token is held back."""
RETURN_GRACE = 2.0
"""Host seconds after the router's return for all processes to find it; they wait up to 0.5 s between attempts."""


class TokenLossFilter:
    """Pure: fed with tokens, the link and the host's time in seconds."""

    def __init__(self) -> None:
        self._since: dict[str, float] = {}
        self._up = True
        self._quiet_until = float("-inf")

    def take_token(self, key: str, alive: bool, now: float) -> None:
        """A token came or went."""
        if alive:
            self._since.pop(key, None)
        else:
            self._since.setdefault(key, now)

    def take_link(self, up: bool, now: float) -> None:
        """The router was lost or is back."""
        self._up = up
        if up:
            self._quiet_until = now + RETURN_GRACE

    def trusted(self, now: float) -> bool:
        """Whether silence and missing tokens mean anything now."""
        return self._up and now >= self._quiet_until

    def take_due(self, now: float, grace: float = GRACE) -> list[str]:
        """Keys of the tokens that are lost for good; each is returned once.

        Set `grace` to 0 if the link is known to hold, such as by a request that came over it.
        """
        if not self.trusted(now):
            return []
        due = [key for key, since in self._since.items() if now - since >= grace]
        for key in due:
            del self._since[key]
        return due
