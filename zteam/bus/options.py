"""How a process reaches the bus, and the Zenoh configuration that follows (figures: docs/processes.md)."""

import ctypes
import json
import logging
import os
import re
import socket
from contextlib import suppress
from pathlib import Path
from typing import Any, Literal

import msgspec
import zenoh

from zteam.bus.transport import MAX_PAYLOAD, zenoh_text
from zteam.clock import HOST_FACTOR, PATIENCE_BOUNDS
from zteam.config.numbers import parse_number
from zteam.errors import UsageError, printable
from zteam.names import KEYS_WITHOUT_MAPS, service_key
from zteam.version import __version__

log = logging.getLogger("zteam.bus")

DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"
DEFAULT_TLS_ENDPOINT = "tls/127.0.0.1:7447"

FROM_STDIN = "-"
"""`--connect -`: the launcher writes the endpoint to the process's stdin once its router listens, so that the
process can start and import meanwhile."""
_PROTOCOLS = ("tcp", "tls", "udp", "quic", "ws")
"""Of Zenoh, with a host and a port."""
_ENDPOINT = re.compile(
    r"(?:(?P<protocol>[A-Za-z-]+)(?::?[/\\]+|:(?=.*:)))?(?:[^/@]*@)?(?P<host>\[?[\w:.%-]*?\]?)"
    r"(?:(?<!:):(?P<port>[^:?#/\\]*))?(?:(?<=[\w.:\]])(?:[/\\]+[^\s:?#/\\]*)+)?[/\\]*(?P<rest>(?:[?#].*)?)"
)
"""As people write it: tcp://HOST:PORT, tcp:HOST:PORT, HOST:PORT, HOST, PORT, http://USER@HOST:PORT/PATH."""

RELEASE = service_key("@router", "release")
"""Query to a router on demand, a ReleaseRequest: whether it gives its port up."""
LEASE = 2.0 * HOST_FACTOR
"""Host seconds after which a process that is cut off or frozen counts as gone."""
LEASE_BOUNDS = (0.1, 7200.0)
"""Of a lease that a user asks for."""

ROUTER_ANSWER = 5.0
"""Host seconds for the router's answer; it, or a process that it asks, may be busy."""

RUNTIME_VARIABLE = "ZENOH_RUNTIME"
RUNTIMES = {
    "small": "(app: (worker_threads: 1), rx: (handover: app), tx: (handover: app), acc: (handover: app), "
    "net: (handover: app))",
    "usual": "(app: (worker_threads: 1), rx: (handover: app), acc: (handover: app), net: (handover: app))",
    "large": "(app: (worker_threads: 1), rx: (worker_threads: 2), acc: (handover: app), net: (handover: app))",
    "router": "(rx: (worker_threads: 2), app: (handover: rx), acc: (handover: rx), net: (handover: rx))",
}
"""How many threads Zenoh uses in a process, instead of its seven: with many small processes on few cores, most of the
cost of a message is waking threads (docs/benchmarks.md).

`small` is one in all, for processes that send nothing large: an answer that waits for room in the queue, such as a map
for a late subscriber, would wait for the very thread that makes room. `usual` has one more for sending. `large` has two
more for receiving. With `usual` a process with 5 MB of latched messages stood still for 5 s and lost its link: the
thread that waited for room did not look at the socket. The router has two for receiving, so that one that waits for a
slow client does not hold the others.
"""


class TlsFiles(msgspec.Struct, frozen=True):
    """The PEM files with which a process speaks mutual TLS, and nothing else."""

    ca: str
    """The certificate of the team's authority."""
    certificate: str
    key: str

    @classmethod
    def from_environment(cls) -> "TlsFiles | None":
        """What ZTEAM_TLS_CA, ZTEAM_TLS_CERT and ZTEAM_TLS_KEY say; None without them. Raises UsageError."""
        given = [os.environ.get(name) for name in TLS_VARIABLES]
        missing = [name for name, value in zip(TLS_VARIABLES, given, strict=True) if not value]
        if len(missing) == len(given):
            return None
        if missing:
            raise UsageError(f"{' and '.join(missing)}: set {', '.join(TLS_VARIABLES)}, or none of them")
        return cls(*map(str, given))

    @property
    def environment(self) -> dict[str, str]:
        return dict(zip(TLS_VARIABLES, (self.ca, self.certificate, self.key), strict=True))

    @property
    def settings(self) -> dict[str, Any]:
        """Of Zenoh, for a client and for a router, which may call other routers. Raises UsageError."""
        for variable, path in self.environment.items():
            try:
                Path(path).read_bytes()
            except OSError as error:
                raise UsageError(f"{variable} {path}: {error.strerror}") from None
        return {
            "transport/link/protocols": ["tls"],
            "transport/link/tls": {
                "root_ca_certificate": self.ca,
                "listen_certificate": self.certificate,
                "listen_private_key": self.key,
                "connect_certificate": self.certificate,
                "connect_private_key": self.key,
                "enable_mtls": True,
                "verify_name_on_connect": True,
                # Otherwise a link outlives the certificates that it was opened with.
                "close_link_on_expiration": True,
            },
        }


TLS_VARIABLES = ("ZTEAM_TLS_CA", "ZTEAM_TLS_CERT", "ZTEAM_TLS_KEY")
"""In the order of the fields of TlsFiles."""


class BusOptions(msgspec.Struct, frozen=True):
    """Connection options, the same for every command."""

    connect: str | None = None
    """Endpoint of the router; None = the one at DEFAULT_ENDPOINT, started on demand. With `tls` it is the one at
    DEFAULT_TLS_ENDPOINT, and none is started."""
    namespace: str | None = None
    """Prefix that isolates a team from others on the same router."""
    config: str | None = None
    """A Zenoh JSON5 file whose settings are taken first."""
    small: bool = False
    """Whether the process sends small messages only, and works on one thread."""
    lease: float = LEASE
    """Host seconds of silence after which this process counts as gone. Make it longer than the patience of lock-step if
    lock-step shall report a hung process first."""
    tls: TlsFiles | None = None
    """With it this process speaks mutual TLS only."""
    give_up: float | None = None
    """Host seconds without a router after which this process ends; None: it waits for ever."""
    large: bool = False
    """Whether it has latched messages of more than a few megabytes together."""

    @classmethod
    def from_environment(cls) -> "BusOptions":
        """What the environment says; every command's options have these as their defaults. Raises UsageError."""
        connect, namespace, config = (
            os.environ.get(f"ZTEAM_{name}") or None for name in ("CONNECT", "NAMESPACE", "CONFIG")
        )
        lease = _number_from("ZTEAM_LEASE", *LEASE_BOUNDS, "seconds")
        # `clock` has made HOST_FACTOR of it.
        _number_from("ZTEAM_PATIENCE", *PATIENCE_BOUNDS, "a factor")
        tls = TlsFiles.from_environment()
        give_up = _number_from("ZTEAM_GIVE_UP", 0.1, 86_400.0, "seconds")
        return cls(connect, namespace, config, lease=LEASE if lease is None else lease, tls=tls, give_up=give_up)

    @property
    def endpoint(self) -> str:
        """Where the router is, or is to be. Raises UsageError."""
        return check_endpoint(self.connect or default_endpoint(self.tls), self.tls)

    @property
    def words(self) -> dict[str, str]:
        """The options by which a command line reaches the same team, without certificates; "" where it does so
        without. An empty value overrides the environment. Raises UsageError."""
        connect = "" if self.endpoint == DEFAULT_ENDPOINT else self.endpoint
        return {"--connect": connect, "--namespace": self.namespace or "", "--config": self.config or ""}


class Owner(msgspec.Struct, frozen=True):
    """A process's user, as a router reports it in Zenoh's admin space."""

    uid: int | None = None
    pid_namespace: str = ""
    """As Linux names it (pid_namespaces(7)); empty elsewhere. User ids of one namespace can be compared."""
    user: str = ""
    """ZTEAM_OWNER, of a process in a container: its user id says nothing about the host's users. Empty without it."""

    @classmethod
    def of_this_process(cls) -> "Owner":
        try:
            namespace = str(Path("/proc/self/ns/pid").readlink())
        except OSError:
            namespace = ""
        return cls(os.getuid(), namespace, os.environ.get("ZTEAM_OWNER", ""))

    def is_another_user(self) -> bool:
        """Whether this process's user is certainly another one.

        A container has a PID namespace of its own, so its user id is not compared.
        """
        own = Owner.of_this_process()
        if self.user:
            # As docker-compose.yml passes it, also under sudo.
            own_user = own.user or os.environ.get("SUDO_USER") or os.environ.get("USER")
            if own_user and own_user != self.user:
                return True
        return self.uid not in (None, own.uid) and self.pid_namespace == own.pid_namespace

    def __str__(self) -> str:
        return printable(f"user {self.user}" if self.user else f"user id {self.uid}")


def _number_from(variable: str, least: float, most: float, what: str) -> float | None:
    text = os.environ.get(variable)
    try:
        return parse_number(text, least, most, what) if text else None
    except UsageError as error:
        raise UsageError(f"{variable} {error}") from None


def default_endpoint(tls: TlsFiles | None) -> str:
    """Where a router listens, and a client looks for it, unless told otherwise."""
    return DEFAULT_ENDPOINT if tls is None else DEFAULT_TLS_ENDPOINT


def check_endpoint(endpoint: str, tls: TlsFiles | None = None) -> str:
    """The endpoint itself. Raises UsageError with the form that is probably meant, where Zenoh would only wait."""
    if tls is None and re.match("(unixsock-stream|unixpipe|serial|vsock)/.", endpoint):
        return endpoint
    text = re.sub(r"\s*([:/])\s*", r"\1", endpoint.strip(" \t\r\n\"'"))
    # A colon too much, which would make an IPv6 address of HOST:PORT.
    text = re.sub(r"^((?:\w+:?[/\\]+)?[^:/\\]+:\d+):[^:\d]*$", r"\1", text)
    found = _ENDPOINT.fullmatch(re.sub(r"\s+(?=\d+$)", ":", text))
    protocol, host, port, rest = found.group("protocol", "host", "port", "rest") if found else ("?", "", None, "")
    if not protocol and host.lower() in _PROTOCOLS:
        protocol, host, port = host, port or "", None
    host, protocol = host.strip("[]"), (protocol or "tcp").lower()
    protocol = "tcp" if protocol in ("http", "https", "zenoh") else protocol
    if protocol not in _PROTOCOLS:
        raise UsageError(f"endpoint {endpoint!r}: give one PROTOCOL/ADDRESS, such as {default_endpoint(tls)}")
    if not port:
        host, port = ("", host) if host.isdigit() else (host, "7447")
    told = "give PROTOCOL/ADDRESS, such as"
    if tls is not None:
        protocol, told = "tls", f"with {TLS_VARIABLES[0]} it must be"
    try:
        parse_number(port, 0, 65535, "a port")
    except UsageError as error:
        port, told = "7447", f"port {error}, as in"
    meant = f"{protocol}/{f'[{host}]' if ':' in host else host or '127.0.0.1'}:{port}{rest}"
    if meant != endpoint:
        raise UsageError(f"endpoint {endpoint!r}: {told} {meant}")
    return endpoint


def host_port(endpoint: str) -> tuple[str, int] | None:
    """Host and port of a tcp or tls endpoint, None for any other kind."""
    found = _ENDPOINT.fullmatch(endpoint)
    if found is None or found["protocol"] not in ("tcp", "tls") or not (found["port"] or "").isdigit():
        return None
    return found["host"].strip("[]"), int(found["port"])


def port_accepts(endpoint: str, timeout: float = 1.0) -> bool:
    """Whether something accepts TCP connections at `endpoint`."""
    address = host_port(endpoint)
    if address is None:
        return True
    try:
        socket.create_connection(address, timeout=timeout).close()
    except (OSError, UnicodeError):
        # UnicodeError: the name of the host is too long.
        return False
    return True


def check_namespace(namespace: str, source: str) -> str:
    """The namespace without slashes at its ends, or two in a row. Raises UsageError that names its `source`."""
    parts = list(filter(None, namespace.split("/")))
    if not all(re.fullmatch(r"[\w-]+", part) for part in parts):
        raise UsageError(f"{source} {namespace!r}: use letters, digits, '_', '-' and '/'")
    return "/".join(parts)


def share_arenas() -> None:
    """Let the threads of this process share one arena of the C library's memory; call it before there are eight.

    With one for each thread, every router that is lost and found again leaves half a megabyte unused in a process.
    """
    with suppress(OSError, AttributeError):
        # -8 is M_ARENA_MAX (mallopt(3)).
        ctypes.CDLL(None).mallopt(-8, 1)


def open_session(config: zenoh.Config, runtime: str) -> zenoh.Session:
    """`zenoh.open`, with one of RUNTIMES where this is the process's first session and the user chose none.

    Raises zenoh.ZError.
    """
    share_arenas()
    if RUNTIME_VARIABLE in os.environ:
        return zenoh.open(config)
    os.environ[RUNTIME_VARIABLE] = RUNTIMES[runtime]
    try:
        return zenoh.open(config)
    finally:
        # It is read once; a child process makes its own choice. Another thread may have opened a session meanwhile.
        os.environ.pop(RUNTIME_VARIABLE, None)


def _runtime_of(options: BusOptions) -> str:
    return "small" if options.small else "large" if options.large else "usual"


def try_open(options: BusOptions, runtime: str | None = None) -> zenoh.Session | None:
    """A session of a client; None if no router takes it. Raises UsageError."""
    try:
        return open_session(client_config(options), runtime or _runtime_of(options))
    except zenoh.ZError as error:
        log.debug("open: %s", zenoh_text(error))
        return None


def _build(config: str | None, settings: dict[str, Any], *, is_on_demand: bool = False) -> zenoh.Config:
    """The file's settings, and these over them. Raises UsageError; if `is_on_demand`, also for a file with a router."""
    if config is not None and not Path(config).is_file():
        raise UsageError(f"--config {config}: no such file")
    try:
        built = zenoh.Config() if config is None else zenoh.Config.from_file(config)
    except zenoh.ZError as error:
        raise UsageError(f"--config {config}: {zenoh_text(error)}") from None
    if is_on_demand and json.loads(built.get_json("connect/endpoints")):
        raise UsageError(f"--config {config}: its connect/endpoints is not read: name the router with --connect")
    for key, value in settings.items():
        try:
            built.insert_json5(key, json.dumps(value))
        except zenoh.ZError as error:
            raise UsageError(f"Zenoh does not take {key} = {value!r}: {zenoh_text(error)}") from None
    return built


_COMMON: dict[str, Any] = {
    "scouting/multicast/enabled": False,
    # Opening a session waits this long for others even with scouting off.
    "scouting/delay": 0,
    "transport/shared_memory/enabled": False,
    # The default of 2 batches loses messages in bursts; 16 lost none in 76,000 ticks of 20 robots.
    "transport/link/tx/queue/size/data": 16,
    # A larger one is refused anyway; the default of 1 GB would be held in memory first.
    "transport/link/rx/max_message_size": MAX_PAYLOAD + 2**20,
    # Zenoh's own time stamps need clocks that agree (`stamping_as`).
    "timestamping/enabled": False,
}


_RETRY = {"period_init_ms": 100, "period_max_ms": 500, "period_increase_factor": 1.5}


def client_config(options: BusOptions) -> zenoh.Config:
    """Configuration of a process: a client of one router that retries for ever once it is open."""
    settings: dict[str, Any] = {
        **_COMMON,
        "transport/link/tx/lease": round(options.lease * 1e3),
        "mode": "client",
        "connect/endpoints": [options.endpoint],
        "listen/endpoints": [],
        # The first attempt fails at once, so that the caller can start a router or say what it waits for.
        "connect/timeout_ms": 0,
        "connect/retry": _RETRY,
        # Something that holds the port and says nothing would block the default of 10 s.
        "transport/unicast/open_timeout": 2000,
    }
    if options.tls is not None:
        # A router works off TLS handshakes that failed one by one, 0.1 s for each. To give up sooner adds one more: 40
        # clients that gave up after 2 s were kept out for ever, by each other.
        settings |= {**options.tls.settings, "transport/unicast/open_timeout": 10_000}
    if namespace := check_namespace(options.namespace or "", "namespace"):
        settings["namespace"] = namespace
    return _build(options.config, settings, is_on_demand=options.connect is None)


def _rule(name: str, messages: list[str], key_exprs: list[str], **action: object) -> list[dict[str, object]]:
    """For messages that come to a router on some keys."""
    return [{"id": name, "messages": messages, "key_exprs": key_exprs, "flows": ["ingress"], **action}]


class RouterOptions(msgspec.Struct, frozen=True):
    """A router; `config`, `lease` and `tls` are those of BusOptions: each side of a link says how long the other is to
    bear its silence."""

    listen: tuple[str, ...]
    """Endpoints."""
    connect: tuple[str, ...] = ()
    """Endpoints of other hosts' routers, to which it links itself as soon as they are there."""
    config: str | None = None
    lease: float = LEASE
    tls: TlsFiles | None = None
    idle_exit: float | None = None
    """Seconds without a client after which it ends. Only a router on demand has them; it gives its port up, too."""
    for_team: Literal["", "starts", "returns"] = ""
    """The router of a team that starts, or that is started again, gets its port from one on demand."""


def router_config(options: RouterOptions) -> zenoh.Config:
    """Configuration of the router, which tells its user id and process id."""
    tls = options.tls
    return _build(
        options.config,
        {
            **_COMMON,
            "transport/link/tx/lease": round(options.lease * 1e3),
            "mode": "router",
            "listen/endpoints": [check_endpoint(endpoint, tls) for endpoint in options.listen],
            "connect/endpoints": [check_endpoint(endpoint, tls) for endpoint in options.connect],
            # It routes for its own host while the other one is away, and goes on asking for that.
            "connect/timeout_ms": -1,
            "connect/exit_on_failure": False,
            "connect/retry": {**_RETRY, "period_max_ms": 100},
            # One try sends one packet to a host that is cut off, so the link is back within a second. Closing the
            # session waits for a try that is under way; a router must end within 1.5 s.
            "transport/unicast/open_timeout": 700,
            # With the default of 100, a few hundred connections that say nothing keep all others out.
            "transport/unicast/accept_pending": 1000,
            # What a sender marks with BLOCK would hold a thread of the router until the slowest receiver has room, and
            # with it the messages and signs of life of all sessions.
            "qos/network": _rule("never_block", ["put", "delete"], ["**"], overwrite={"congestion_control": "drop"}),
            # On keys that carry no map: an image of 1920 x 1080 has 6 MB. Receivers would hold the pieces of a larger
            # message until the last has come.
            "low_pass_filter": _rule("no_large_ones", ["put"], [*KEYS_WITHOUT_MAPS], size_limit=16 * 1024 * 1024),
            "adminspace/enabled": True,
            "metadata": {
                "name": "zteam-router",
                "owner": msgspec.to_builtins(Owner.of_this_process()),
                "pid": os.getpid(),
                "version": __version__,
                "on_demand": options.idle_exit is not None,
            },
            **(tls.settings if tls is not None else {}),
        },
    )
