"""The zteam routers of this user on this machine, as Linux tells them; elsewhere none are found."""

from collections.abc import Iterator
from pathlib import Path

_PROC = Path("/proc")
_COMMAND = "zteam-router"
"""As it shows itself (`zteam.runtime.process_name`)."""
_LISTENS = "0A"


def find_local_routers() -> list[str]:
    """The endpoints at which they listen, sorted; IPv4 only."""
    found: set[str] = set()
    for folder in _PROC.glob("[0-9]*"):
        try:
            if (folder / "comm").read_text().rstrip("\n") == _COMMAND:
                found.update(_endpoints(folder))
        except OSError:
            # It has just ended, or belongs to another user.
            continue
    return sorted(found)


def _endpoints(folder: Path) -> Iterator[str]:
    inodes = {str(link.readlink()).removeprefix("socket:[").removesuffix("]") for link in (folder / "fd").iterdir()}
    for line in (folder / "net" / "tcp").read_text().splitlines()[1:]:
        fields = line.split()
        if fields[3] == _LISTENS and fields[9] in inodes:
            address, _, port = fields[1].partition(":")
            yield f"tcp/{_host(address)}:{int(port, 16)}"


def _host(address: str) -> str:
    """The address of hexadecimal digits in the order of the machine; the loopback for all interfaces."""
    parts = [str(part) for part in bytes.fromhex(address)[::-1]]
    return "127.0.0.1" if parts == ["0"] * 4 else ".".join(parts)
