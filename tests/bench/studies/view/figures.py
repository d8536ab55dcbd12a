"""The figures of a view: how old frames are, memory, slow pages, its cost for a run in lock-step, and the drawing."""

import os
import statistics
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec

from studies.view.browser import DrawFigures, measure_drawing
from studies.view.foxglove import FoxgloveFigures, measure_foxglove
from studies.view.page import FrameFigures, Page
from studies.view.stage import TOKEN, crowd, processes, start_view, team
from studies.view.starting import StartFigures, measure_start
from zteam.cli.bench_team import write_line_team
from zteam.errors import ZteamError
from zteam.team.launch.process import zteam_command
from zteam.team.run.report import RunReport

PARTS = ("load", "slow", "many", "cost", "foxglove", "browser", "start")
SLOW_FRAME = 0.5
"""Host seconds that a slow page takes a frame."""
MANY, STARTS = 10, 5
"""Pages at once; starts of a team for each figure."""
COST_RUN = 300
"""Simulated seconds of a run in lock-step: six seconds of the host, so that its beginning counts little."""
BEAMS = {4: 360, 100: 360, 1000: 90}
"""Beams of a scan by the number of robots."""

Progress = Callable[[str], None]


class LoadFigures(msgspec.Struct):
    """One page at a view of so many robots."""

    robots: int
    page: FrameFigures
    pss_mb: float
    rss_mb: float


class SlowFigures(msgspec.Struct):
    """Pages beside one that takes 0.5 s a frame."""

    fast: FrameFigures
    slow: FrameFigures


class CostFigures(msgspec.Struct):
    """A run in lock-step without and with one page, in turn."""

    alone: list[float]
    """Real-time factors."""
    watched: list[float]
    slow_down: float
    """Median over the pairs of 1 - watched / alone."""
    same_trajectory: bool


class ViewFigures(msgspec.Struct):
    """All of them; None for what was not measured."""

    loads: list[LoadFigures] = []
    slow: SlowFigures | None = None
    cost: CostFigures | None = None
    drawings: list[DrawFigures] = []
    many: list[FrameFigures] = []
    """Of ten pages at once at one view."""
    foxglove: FoxgloveFigures | None = None
    start: StartFigures | None = None
    no_browser: str = ""
    """Why nothing was drawn."""


def measure_view(
    world: Path, seconds: float, pairs: int, parts: tuple[str, ...], progress: Progress = lambda _text: None
) -> ViewFigures:
    """Measure `parts` of PARTS; a load for `seconds`, the cost in so many pairs."""
    figures = ViewFigures()
    if "load" in parts:
        for robots in (4, 100):
            progress(f"one page, {robots} robots")
            figures.loads.append(measure_load(robots, seconds))
    if "slow" in parts:
        progress("a slow page beside a fast one")
        figures.slow = measure_slow_page(seconds)
    if "many" in parts:
        progress(f"{MANY} pages at once")
        figures.many = measure_many_pages(seconds)
    if "cost" in parts:
        figures.cost = measure_cost(world, pairs, progress)
    if "foxglove" in parts:
        progress("a client of Foxglove's protocol, 20 robots")
        figures.foxglove = measure_foxglove(seconds)
    try:
        for robots in (100, 1000) if "browser" in parts else ():
            progress(f"a browser, {robots} robots")
            with crowd(robots, BEAMS[robots]) as stage:
                figures.drawings.append(measure_drawing(stage.url, robots, BEAMS[robots], seconds))
        if "start" in parts:
            progress("from the command to a drawn robot")
            figures.start = measure_start(STARTS)
    except ZteamError as error:
        figures.no_browser = str(error)
    return figures


def measure_load(robots: int, seconds: float) -> LoadFigures:
    """One page: with 4 robots of a whole team, with more of the simulator alone."""
    with team("line") if robots == 4 else crowd(robots, BEAMS[robots]) as stage:
        page = Page(stage.port, TOKEN, seconds)
        page.start()
        figures = page.figures()
        usage = stage.view_usage()
        return LoadFigures(robots, figures, round(usage.pss_mb, 1), round(usage.rss_mb, 1))


def measure_slow_page(seconds: float) -> SlowFigures:
    """Two pages at one view of a team of four; one of them takes its time."""
    with team("line") as stage:
        pages = [Page(stage.port, TOKEN, seconds), Page(stage.port, TOKEN, seconds, delay=SLOW_FRAME)]
        for page in pages:
            page.start()
        return SlowFigures(*(page.figures() for page in pages))


def measure_many_pages(seconds: float) -> list[FrameFigures]:
    """Ten pages at one view of a team of four."""
    with team("line") as stage:
        pages = [Page(stage.port, TOKEN, seconds) for _ in range(MANY)]
        for page in pages:
            page.start()
        return [page.figures() for page in pages]


def measure_cost(world: Path, pairs: int, progress: Progress) -> CostFigures:
    """Runs of a line of four robots in lock-step, as fast as they go, alone and watched by one page, in turn."""
    alone: list[float] = []
    watched: list[float] = []
    hashes = set()
    for pair in range(pairs):
        # The first run of a pair is another one each time: the machine may become faster or slower meanwhile.
        for is_watched in (False, True) if pair % 2 == 0 else (True, False):
            progress(f"lock-step, pair {pair + 1} of {pairs}, {'watched' if is_watched else 'alone'}")
            report = _run(world, is_watched)
            (watched if is_watched else alone).append(report.real_time_factor or 0.0)
            hashes.add(report.trajectory_sha256)
    ratios = [1.0 - seen / unseen for unseen, seen in zip(alone, watched, strict=True)]
    return CostFigures(alone, watched, statistics.median(ratios), len(hashes) == 1)


def _run(world: Path, is_watched: bool) -> RunReport:
    with TemporaryDirectory() as name, processes() as (supervisor, endpoint):
        folder = Path(name)
        file, report = write_line_team(world, 4, 1081, folder), folder / "report.json"
        port = start_view(supervisor, endpoint)
        page = Page(port, TOKEN, 600.0) if is_watched else None
        if page is not None:
            page.start()
        options = ("--lockstep", "--for", str(COST_RUN), "--report", str(report), "--connect", endpoint)
        search = os.pathsep.join([str(world.resolve().parent), os.environ.get("STAGEPATH", "")])
        command = zteam_command("zteam", "up", str(file), *options)
        up = supervisor.start("up", command, {"STAGEPATH": search})
        supervisor.wait(lambda: not up.running, 180.0)
        if page is not None:
            page.stop()
        if up.exit_code != 0:
            raise ZteamError(f"the run failed: {list(up.lines)[-3:]}")
        return msgspec.json.decode(report.read_bytes(), type=RunReport)
