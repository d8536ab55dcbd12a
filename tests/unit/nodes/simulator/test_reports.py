"""The answers to `sim/status` and `sim/report`."""

from collections.abc import Iterator

import msgspec
import pytest

from support.simulator_parts import SimulatorParts
from zteam.bus import MemoryHub


@pytest.fixture
def parts(hub: MemoryHub) -> Iterator[SimulatorParts]:
    """A simulator after three ticks, the last of them after GO."""
    made = SimulatorParts(hub)
    made.whole_tick()
    made.whole_tick()
    made.take_go(made.engine.now)
    made.whole_tick()
    yield made
    made.close()


def test_the_report_has_these_members(parts: SimulatorParts) -> None:
    """Programs read its JSON: the names stay."""
    report = msgspec.json.decode(msgspec.json.encode(parts.report(True)))
    assert set(report) == {
        "sim_seconds", "seed", "external_commands", "finished", "robots", "latency_ms", "ticks", "wall_seconds",
        "real_time_factor", "trajectory_sha256", "lockstep", "resends", "hung", "timing_ms", "lateness_p99_ms",
    }  # fmt: skip


def test_the_report_takes_its_figures_from_the_parts(parts: SimulatorParts) -> None:
    """Statistics, profile and pacer; without lock-step nothing was repeated."""
    parts.whole_tick()
    report = parts.report(finished=False)
    assert (report.sim_seconds, report.ticks, report.finished) == (0.2, 2, False)
    assert report.trajectory_sha256 == parts.statistics.trajectory_sha256
    assert report.timing_ms == parts.profile.timing()
    assert report.real_time_factor == pytest.approx(0.1 / report.wall_seconds)
    assert (report.lockstep, report.resends, report.hung, report.lateness_p99_ms) == (False, 0, [], None)


def test_a_real_time_factor_needs_two_ticks(parts: SimulatorParts) -> None:
    """With one there is no time to divide by."""
    report = parts.report(finished=False)
    assert (report.wall_seconds, report.real_time_factor) == (0.0, None)


def test_the_status_tells_the_session_and_the_world(parts: SimulatorParts) -> None:
    """The session id is what requests for changes carry."""
    status = parts.status(finished=True)
    assert (status.instance, status.finished, status.lockstep) == (parts.node.bus.instance, True, False)
    assert (status.robots, status.tick, status.now) == ([0, 1, 2], 3, 3 * parts.world.interval)
