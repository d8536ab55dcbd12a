"""The floor of a lock-step tick: the time to exchange its messages through the router, and nothing else."""

import sys
from contextlib import closing
from pathlib import Path

import msgspec

from studies.bare_zenoh import START_LIMIT, TICK_LIMIT, Exchanged
from studies.router import start_router
from zteam import names
from zteam.cli.bench import figure
from zteam.cli.bench_team import measure_team
from zteam.errors import UsageError, ZteamError
from zteam.node.kinds import ROUTER
from zteam.team.launch.process import Process, exit_text
from zteam.team.launch.supervisor import Member, Supervisor
from zteam.world import load_world

_SECONDS = 4.0


class FloorFigures(msgspec.Struct):
    """One run, by the host's clock."""

    robots: int
    beams: int
    ticks_per_s: float
    tick_ms: float
    rtf: float
    """Simulated seconds per host second if a tick only exchanged messages."""
    lost: int
    """Ticks that a process did not answer in time."""


def measure_floor(robots: int, beams: int, seconds: float, interval: float = 0.1) -> FloorFigures:
    """Exchange ticks of `interval` simulated seconds between real processes for `seconds` host seconds.

    Raises ZteamError that names the process that failed.
    """
    if robots < 1 or beams < 1 or not seconds > 0 or not interval > 0:
        raise UsageError("the floor needs at least one robot and one beam, and seconds and an interval above 0")
    exchanged = _run(robots, beams, seconds)
    if exchanged.ticks == 0:
        raise ZteamError(f"not one tick was answered in {exchanged.seconds:.1f} s")
    ticks_per_s = exchanged.ticks / exchanged.seconds
    return FloorFigures(
        robots=robots,
        beams=beams,
        ticks_per_s=ticks_per_s,
        tick_ms=1e3 / ticks_per_s,
        rtf=ticks_per_s * interval,
        lost=exchanged.lost,
    )


class TeamAndFloor(msgspec.Struct):
    """A team in lock-step, and the same exchange of messages right after it."""

    robots: int
    beams: int
    rtf: float
    """Of the team."""
    floor_rtf: float
    ratio: float
    """rtf / floor_rtf; 1 is as fast as the transport alone."""


def measure_floor_of(world: Path, robots: int, beams: int, seconds: float) -> TeamAndFloor:
    """Run a line of robots (`zteam bench team`), then the exchange of its messages."""
    rtf = measure_team(world, robots, beams, seconds).rtf
    if not rtf:
        raise ZteamError("the team was over before GO: give more --seconds")
    floor = measure_floor(robots, beams, _SECONDS, load_world(world).interval / 1e9).rtf
    return TeamAndFloor(robots, beams, rtf, floor, rtf / floor)


def format_floor(found: TeamAndFloor) -> str:
    """One line."""
    factors = f"team {figure(found.rtf)}, bare Zenoh {figure(found.floor_rtf)} simulated seconds a second"
    return f"{found.robots} robots, {found.beams} beams: {factors}; team / bare Zenoh {figure(found.ratio)}"


def _run(robots: int, beams: int, seconds: float) -> Exchanged:
    count = ["--robots", str(robots)]
    # START_LIMIT three times: the simulator's own start, its wait for the team, and the warm-up.
    limit = 3 * START_LIMIT + seconds + TICK_LIMIT
    with closing(Supervisor(lambda _name, _line: None, lambda _process, _delay: None)) as supervisor:
        try:
            endpoint = start_router(supervisor)
            supervisor.start(names.AGGREGATOR, _command("aggregator", endpoint, *count))
            for i in range(robots):
                supervisor.start(names.robot_name(i), _command("robot", endpoint, "--id", str(i)))
            rest = ["--beams", str(beams), "--seconds", str(seconds)]
            simulator = supervisor.start(names.SIMULATOR, _command("simulator", endpoint, *count, *rest))
            return _wait_for_result(supervisor, simulator, limit)
        except OSError as error:
            raise ZteamError(f"cannot start the processes of the exchange: {error}") from None
        finally:
            # The router last: sessions that lose it try to reconnect.
            supervisor.stop(sorted(supervisor.processes.keys() - {ROUTER}))
            supervisor.stop([ROUTER])


def _command(role: str, endpoint: str, *arguments: str) -> list[str]:
    return [sys.executable, "-P", "-m", "studies.bare_zenoh", role, "--connect", endpoint, *arguments]


def _wait_for_result(supervisor: Supervisor, simulator: Process, limit: float) -> Exchanged:
    # No process was asked to end, so each one that ends counts as a failure. The first should be the simulator, with 0.
    if not supervisor.wait(lambda: bool(supervisor.failures), limit):
        raise ZteamError(f"the exchange was not over within {limit:g} s")
    first = supervisor.failures[0]
    if first is not simulator or first.exit_code != 0:
        raise ZteamError(_failure_text(first))
    try:
        return msgspec.json.decode(simulator.lines[-1], type=Exchanged)
    except (IndexError, msgspec.DecodeError):
        raise ZteamError(_failure_text(first)) from None


def _failure_text(process: Member) -> str:
    last = list(process.lines)[-1] if process.lines else "no output"
    return f"{process.name} of the exchange failed ({exit_text(process.exit_code)}): {last}"
