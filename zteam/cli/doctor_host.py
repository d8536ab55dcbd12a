"""What `zteam doctor` learns of this machine: versions, and the router."""

import platform
from importlib.metadata import PackageNotFoundError, version

from zteam.bus import BusOptions
from zteam.bus.connection import read_admin
from zteam.bus.probe import port_accepts, why_refused
from zteam.diagnosis.finding import Finding, ok, problem
from zteam.launch import kinds

_PACKAGES = ("zteam", "eclipse-zenoh", "numpy", "msgspec", "pymunk", "pillow")


def check_versions() -> Finding:
    """The versions of the packages that zteam needs."""
    found = [f"python {platform.python_version()}"]
    for package in _PACKAGES:
        try:
            found.append(f"{package} {version(package)}")
        except PackageNotFoundError:
            found.append(f"{package} missing")
    return ok("versions", ", ".join(found))


def check_router(options: BusOptions) -> Finding:
    """Whether a Zenoh router answers."""
    endpoint = options.endpoint
    if not port_accepts(endpoint):
        return problem("router", f"nothing listens at {endpoint}", kinds.ROUTER_KIND.hint)
    admin = read_admin(options)
    if admin is None:
        return problem("router", *why_refused(endpoint))
    data = admin.metadata
    router = "zteam-router" if data and data.name else "a Zenoh router that is not zteam's"
    pid = f", process {data.pid}" if data and data.pid else ""
    return ok("router", f"{router} at {endpoint}{pid}, Zenoh {admin.version.partition('-')[0] or '?'}")
