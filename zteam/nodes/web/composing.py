"""The next frame of one page: what it looks at and does not have yet."""

from zteam import names
from zteam.clock import monotonic, to_seconds
from zteam.nodes.web import frames
from zteam.nodes.web.hub import Hub
from zteam.nodes.web.interest import robots_in_sight
from zteam.nodes.web.scene import TILES, Scene
from zteam.nodes.web.viewer import Viewer

TEAM_AGAIN = 1.0
"""Host seconds after which `team` is sent again."""


class Composer:
    """Makes frames for all pages, on one thread."""

    def __init__(self, hub: Hub) -> None:
        self._hub = hub
        self.scene = Scene(hub)

    def compose(self, viewer: Viewer) -> bytes | None:
        """The next frame; None if there is nothing new."""
        scene, hub = self.scene, self._hub
        scene.look()
        blocks = []
        number, poses = scene.poses()
        has_poses = bool(number) and viewer.lacks("poses", number)
        if has_poses:
            blocks.append(poses)
        blocks += self._scans(viewer)
        blocks += self._docs(viewer)
        blocks += self._grids(viewer)
        if not blocks:
            return None
        now = monotonic()
        places = hub.places
        age = now - places.time if has_poses else -1.0
        sim = hub.facts.sim
        tick = places.stamp // sim.interval if sim and sim.interval > 0 else 0
        header = frames.Frame(viewer.next_frame(now), tick, to_seconds(places.stamp), age)
        return frames.encode_frame(header, blocks)

    def _scans(self, viewer: Viewer) -> list[bytes]:
        if "scans" not in viewer.look.layers:
            return []
        found = []
        for robot_id in robots_in_sight(viewer, self._hub.poses):
            for key, number, block in self.scene.scans(robot_id, viewer.look.beams):
                if viewer.lacks(key, (number, viewer.look.beams)):
                    found.append(block)
        return found

    def _docs(self, viewer: Viewer) -> list[bytes]:
        team = self.scene.team()
        due = int(monotonic() / TEAM_AGAIN)
        if viewer.lacks("team", hash(team)) | viewer.lacks("team again", due):
            return [frames.encode_doc("team", team)]
        return []

    def _grids(self, viewer: Viewer) -> list[bytes]:
        found: list[bytes] = []
        viewer.lacks_tiles = False
        for tile in self.scene.grid(names.MAP):
            if len(found) >= TILES:
                viewer.lacks_tiles = True
                break
            if viewer.lacks((names.MAP, tile.place), tile.version):
                found.append(tile.block)
        return found
