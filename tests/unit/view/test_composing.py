"""Which tiles of grids go into the next frame of a page."""

from types import SimpleNamespace
from typing import Any

from zteam.geometry import Pose2
from zteam.view.commands import Tile
from zteam.view.composing import FRAME_BYTES, Composer
from zteam.view.frames import _HEADER, encode_poses
from zteam.view.received import Received, Viewer
from zteam.view.requests import Look

COSTMAPS = [f"robot_{i}/local_costmap/costmap" for i in range(3)]


class Page:
    """A page on a slow link that shows costmaps."""

    def __init__(self) -> None:
        self.viewer = Viewer(1, may_command=False)
        self.viewer.look = Look(layers=["costmaps"])
        self.tiles: dict[str, list[Tile]] = {}
        state: Any = SimpleNamespace(
            received=Received(lambda: None),
            drawables=SimpleNamespace(of=lambda _layer: COSTMAPS),
            queries=SimpleNamespace(alive=lambda _name: False),
        )
        self._composer = Composer(state)
        self._composer._scene = SimpleNamespace(grid=lambda key: self.tiles.get(key, []))  # type: ignore[assignment]

    def change(self, key: str, version: int) -> None:
        """A grid has other cells: one tile, of which a frame takes one."""
        self.tiles[key] = [Tile((0, 0, 1, 1), bytes([version]), key.encode() + bytes(FRAME_BYTES // 2))]

    def next_frame(self) -> set[str]:
        """The grids of which tiles go into it."""
        blocks = self._composer._grids(self.viewer, FRAME_BYTES * 3 // 4)
        return {block.partition(bytes(1))[0].decode() for block in blocks}


def test_grids_that_change_all_the_time_have_their_turns() -> None:
    """However little goes into one frame, each costmap is shown."""
    page, shown = Page(), set[str]()
    for version in range(3):
        for key in COSTMAPS:
            page.change(key, version)
        shown |= page.next_frame()
    assert shown == set(COSTMAPS)


def test_tiles_that_the_page_has_need_no_room() -> None:
    """A frame that lacks no tile does not call for another one at once."""
    page = Page()
    for key in COSTMAPS:
        page.change(key, 0)
    while page.next_frame():
        pass
    page.change(COSTMAPS[0], 1)
    assert page.next_frame() == {COSTMAPS[0]}
    assert not page.viewer.cut


def test_poses_that_no_message_brought_have_no_age() -> None:
    """Those of a world that stands come of static transforms: a page must not say that they are hours old."""
    page = Page()
    composer: Any = page._composer
    composer._state.places, composer._state.queries.sim = SimpleNamespace(stamp=5, time=0.0, eras=0, pose_of=None), None
    composer._state.drawables.of = lambda _layer: []
    composer._scene.poses = lambda: ((0, 1), encode_poses({1: Pose2(1.0, 0.0, 0.0)}, truth=False))
    composer._docs = lambda _viewer, _now: []
    frame = composer.compose(page.viewer)
    assert frame is not None and _HEADER.unpack_from(frame)[-1] == -1.0
