"""The doctor: what is wrong with a team, from its router on. `zteam doctor` prints it, and the view shows it."""

import platform
from contextlib import closing
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import msgspec

from zteam.bus import BusOptions, connect
from zteam.bus.connection import why_foreign, why_refused
from zteam.bus.options import TlsFiles, default_endpoint, host_port, port_accepts
from zteam.bus.router import read_admin
from zteam.bus.tls import own_fault, own_identity
from zteam.clock import utc_text, wall_ns
from zteam.monitor.doctor.checks import check_elsewhere, check_team
from zteam.monitor.doctor.collecting import at_other_routers, collect_facts
from zteam.monitor.doctor.facts import Facts, Finding, note, ok, problem
from zteam.monitor.doctor.maps import check_map_file
from zteam.node import kinds
from zteam.simulator.client import MapInfo

_LOOPBACK = ("127.0.0.1", "localhost", "::1")
_PATIENCE = 5.0
"""Host seconds to wait for a router that answers."""
_DAY = 86_400.0
_SOON = 14 * _DAY
"""Seconds before its end in which a certificate is warned of."""


def check_versions() -> Finding:
    """The versions of the packages that zteam needs."""
    found = [f"python {platform.python_version()}"]
    for package in ("zteam", "eclipse-zenoh", "numpy", "msgspec", "pymunk", "pillow"):
        try:
            found.append(f"{package} {version(package)}")
        except PackageNotFoundError:
            found.append(f"{package} missing")
    return ok("versions", ", ".join(found))


def check_router(options: BusOptions) -> Finding:
    endpoint = options.endpoint
    if not port_accepts(endpoint):
        return problem("router", f"nothing listens at {endpoint}", kinds.ROUTER_KIND.hint)
    admin = read_admin(options)
    if admin is None:
        return problem("router", *why_refused(options))
    if options.connect is None and options.tls is None and (foreign := why_foreign(admin, endpoint)):
        return problem("router", *foreign)
    data = admin.metadata
    router = "zteam-router" if data and data.name else "a Zenoh router that is not zteam's"
    pid = f", process {data.pid}" if data and data.pid else ""
    user = f", of {data.owner}" if why_foreign(admin, endpoint) and data else ""
    return ok("router", f"{router} at {endpoint}{pid}{user}, Zenoh {admin.version.partition('-')[0] or '?'}")


def check_default_port(options: BusOptions) -> list[Finding]:
    """What tools without --connect find, where the team's router of this machine is not at the default port."""
    address, default = host_port(options.endpoint), default_endpoint(options.tls)
    if address is None or address[0] not in _LOOPBACK or options.endpoint == default or not port_accepts(default):
        return []
    found = check_router(msgspec.structs.replace(options, connect=default)).text
    step = f"export ZTEAM_CONNECT={options.endpoint}"
    return [note("router", f"tools without --connect use another port: {found}", step)]


def check_certificate(tls: TlsFiles) -> Finding:
    """Which certificate this process shows the router, and how long that is valid."""
    if fault := own_fault(tls):
        text, _, step = fault.partition(": ")
        return problem("certificate", text, step)
    return check_expiry(*own_identity(tls), Path(tls.certificate).parent)


def check_expiry(name: str, expires: float, folder: Path) -> Finding:
    """How long a certificate in `folder` is valid that ends at `expires`, in seconds since the Unix epoch."""
    left = expires - wall_ns() / 1e9
    if left > _SOON:
        return ok("certificate", f"{name}, valid for {left // _DAY:.0f} days")
    text = f"the certificate {name} {'expires' if left > 0.0 else 'has expired'} on {utc_text(expires)}"
    # `certs` is where `zteam certs` looks by itself.
    option = "" if folder == Path("certs") else f" --folder {folder}"
    step = f"zteam certs renew {name.rpartition('.')[0]}{option}"
    return (note if left > 0.0 else problem)("certificate", text, step)


def examine(options: BusOptions, map_file: tuple[str, MapInfo] | None = None) -> list[Finding]:
    """Everything that is found. Raises ZteamError.

    Also compares a map's file, by its name, with the running world.
    """
    router = check_router(options)
    certificates = [] if options.tls is None else [check_certificate(options.tls)]
    findings = [check_versions(), *certificates, router, *check_default_port(options)]
    if not router.good:
        return [*findings, *check_elsewhere(Facts(routers=at_other_routers(options, "")))]
    with closing(connect(msgspec.structs.replace(options, connect=options.endpoint), patience=_PATIENCE)) as bus:
        facts = collect_facts(bus, options)
    findings += check_team(facts)
    return findings if map_file is None else [*findings, check_map_file(*map_file, facts.sim)]
