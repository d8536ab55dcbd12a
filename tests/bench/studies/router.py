"""A router of an exchange, in a process of its own."""

from pathlib import Path

from zteam.bus.options import RouterOptions
from zteam.errors import ZteamError
from zteam.node.kinds import ROUTER
from zteam.node.process_options import to_line
from zteam.team.launch.plan import MEMBER
from zteam.team.launch.supervisor import Job, Supervisor
from zteam.team.security.certificates import ACCESS, files_of

_LIMIT = 60.0
"""Host seconds for it to start."""


def start_router(supervisor: Supervisor, certificates: Path | None = None) -> str:
    """Start a router, with a folder of certificates over TLS; its endpoint. Raises ZteamError."""
    options = RouterOptions(("tcp/127.0.0.1:0",))
    if certificates is not None:
        access = str(certificates.resolve() / ACCESS)
        options = RouterOptions(("tls/127.0.0.1:0",), config=access, tls=files_of(certificates, ROUTER))
    router = supervisor.start_job(ROUTER, Job(MEMBER, words=to_line(ROUTER, options)))
    supervisor.wait(lambda: not router.running or bool(router.report.listening), _LIMIT)
    if not router.report.listening:
        raise ZteamError(f"the router did not start: {list(router.lines)[-1:]}")
    return router.report.listening
