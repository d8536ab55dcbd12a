"""Why there is no transform between two frames, and why the aggregator refuses a fixed one, in words for a user."""

from collections.abc import Mapping

from zteam import names
from zteam.bus import Bus
from zteam.bus.graph import find_graph, near_keys
from zteam.errors import BusError
from zteam.messages import TransformStamped
from zteam.transforms import FrameInfo, TransformException
from zteam.transforms.client import StaticRequest, TransformClient, find_frames
from zteam.transforms.merge import TEAM_FILE

NO_AGGREGATOR = "no aggregator runs: start one with 'zteam-tf' (a team of 'zteam up' has one)"
_ENDED = 1_000_000_000
"""Nanoseconds behind the newest frame after which a frame has no publisher any more."""
_SEE_TREE = " (see 'zteam tf tree')"


def find_last(bus: Bus, target: str, source: str) -> TransformStamped | str:
    """The aggregator's newest transform between two frames; or why there is none."""
    frames = find_frames(bus)
    if frames is None:
        return NO_AGGREGATOR
    known = names_in(frames)
    missing = [frame for frame in (target, source) if frame not in known]
    if missing:
        return "; ".join(f"frame {frame!r} does not exist{near_keys(frame, known)}" for frame in missing) + _SEE_TREE
    try:
        return TransformClient(bus).lookup_transform(target, source)
    except (TransformException, BusError) as error:
        return (_ended(frames, target, source) or str(error).strip()) + _SEE_TREE


def _ended(frames: Mapping[str, FrameInfo], *ends: str) -> str:
    """The frame above these that is far behind the newest one of the tree, in words; empty if there is none."""
    above = set(ends)
    for end in ends:
        while end in frames:
            end = frames[end].parent
            above.add(end)
    moving = [(info.newest, child) for child, info in frames.items() if child in above and not info.static]
    newest = max((info.newest for info in frames.values()), default=0)
    stamp, child = min(moving, default=(newest, ""))
    if newest - stamp < _ENDED:
        return ""
    text = f"{child} was said last at {stamp / 1e9:.3f} s, {(newest - stamp) / 1e9:.1f} s before the newest frame"
    return f"{text}: its publisher ({frames[child].authority}) has ended"


def names_in(frames: Mapping[str, FrameInfo]) -> set[str]:
    """The frames of a tree, its roots included."""
    return {*frames, *(info.parent for info in frames.values())}


def why_refused(bus: Bus, request: StaticRequest, refused: str) -> str:
    """Which process has the frame already, and what to do; else what the aggregator says."""
    caller = f"{names.STATIC_CALLER} "
    frame = (find_frames(bus) or {}).get(request.child)
    if frame is None or frame.authority == caller + request.caller:
        return refused
    edge, robot_id = f"{frame.parent} -> {request.child}", names.robot_id_of(request.child.partition("/")[0])
    if frame.authority == TEAM_FILE:
        return f"the team file of zteam-tf has {edge} already: change it there"
    if robot_id is None or frame.authority.startswith(caller):
        holder = frame.authority.replace(caller, "another 'zteam tf static', session ", 1)
        return f"{holder} has {edge} already: end that one, or name another child frame"
    key = names.robot_key(robot_id, names.TF_STATIC if frame.static else names.TF)
    publishers = frame.authority if frame.static else ", ".join(find_graph(bus).publishers(key)) or frame.authority
    if names.is_robot_frame(request.child, names.ODOM):
        way_out = "to set a start pose, put it into [[static_transforms]] of the team file that zteam-tf reads"
    else:
        way_out = "nothing is left to do for this frame; for a frame of your own name another child"
    return f"{publishers} publishes {edge} already, on {key}: {way_out}"
