"""The links of a team that was started with `--chaos`: each process has its own, which can be cut or made slow."""

from typing import TYPE_CHECKING, Annotated

import msgspec

from zteam import names
from zteam.bus import Bus, Change
from zteam.bus.options import host_port
from zteam.config.numbers import MAX_SECONDS
from zteam.errors import BusError, UsageError

if TYPE_CHECKING:
    from zteam.team.chaos.forwarder import Link


class Wire(msgspec.Struct, frozen=True):
    """One direction of a link. The default is a good one."""

    delay: float = 0.0
    """Host seconds that each byte takes."""
    rate: float | None = None
    """Bytes a host second; None = as fast as they come. With a `delay` a direction holds 4 MiB at most, and without a
    rate as much as 1 MiB a second: then its sender waits."""
    stalled: bool = False
    """Whether no byte passes. What waits passes when this ends."""


class LinkRequest(Change):
    """`up/links`: how the link of a process is from now on, in both directions; a good one by default."""

    name: str
    wire: Wire = Wire()
    seconds: Annotated[float, msgspec.Meta(ge=0.0, le=MAX_SECONDS)] = 0.0
    """Host seconds after which it is a good one again by itself; 0 = never."""


class LinkReply(msgspec.Struct):
    """The processes whose links can be changed."""

    names: list[str]


def no_link(name: str, _wire: Wire, _seconds: float) -> None:
    """In the place of `Links.change`, for a team without links of its own."""
    raise BusError(f"the link of {name} cannot be changed: start the team with 'zteam up --chaos'")


class Links:
    """A link for each process of a team, through this process."""

    def __init__(self) -> None:
        # It imports asyncio, and few teams have links of their own.
        from zteam.team.chaos.forwarder import Forwarder

        self._forwarder = Forwarder()
        self._links: dict[str, Link] = {}

    def endpoint(self, name: str, router: str) -> str:
        """Where the process `name` connects, to reach the router at this endpoint. Raises UsageError."""
        address = host_port(router)
        if address is None:
            raise UsageError(f"{router}: a link can be cut if the router listens at tcp/HOST:PORT or tls/HOST:PORT")
        if name not in self._links:
            self._links[name] = self._forwarder.open(*address)
        link = self._links[name]
        link.target = address
        return f"{router.partition('/')[0]}/{link.endpoint.partition('/')[2]}"

    def change(self, name: str, wire: Wire, seconds: float = 0.0) -> None:
        """Make both directions of a link so; with `seconds`, for so many of the host's. Raises BusError."""
        if name not in self._links:
            raise BusError(f"there is no link of {name!r}; there are those of {', '.join(self._links) or 'no process'}")
        self._links[name].change(wire, wire, seconds)

    def heal(self) -> None:
        """Make all links good ones."""
        for name in self._links:
            self.change(name, Wire())

    def serve(self, bus: Bus) -> None:
        """Let `zteam chaos` change links."""

        def answer(request: LinkRequest) -> LinkReply:
            self.change(request.name, request.wire, request.seconds)
            return LinkReply([*self._links])

        bus.serve(names.service_key(names.LAUNCHER, names.LINKS), LinkRequest, answer)

    def close(self) -> None:
        """End all links, and with them the processes' connections."""
        self._forwarder.close()
