"""The parameters of `follow`, for all its laws."""

import math
from typing import Annotated, Literal

from msgspec import Meta, Struct

from zteam import names
from zteam.behaviors.line import OnLeaderLost

Law = Literal["trail", "direct"]
Successor = Literal["same", "idle", "forward", "avoid", "wander"]


class FollowParams(Struct, frozen=True, forbid_unknown_fields=True):
    """Parameters of `follow`; only the leader has to be given."""

    leader: Annotated[int, Meta(ge=0, le=names.MAX_ROBOT_ID, description="id of the robot to follow")]
    law: Annotated[Law, Meta(description="trail: along the leader's trail; direct: straight to the leader")] = "trail"
    gap: Annotated[
        float, Meta(ge=0.4, le=100.0, description="m along the trail to the robot ahead, base to base; law trail")
    ] = 0.8
    min_dist: Annotated[
        float, Meta(ge=0.0, le=100.0, description="m; it stands while the leader is nearer; law direct")
    ] = 0.8
    max_linear: Annotated[float, Meta(ge=0.0, le=1.0, description="m/s")] = 0.7
    max_angular: Annotated[float, Meta(ge=0.0, le=math.pi, description="rad/s")] = 3.14
    stale_after: Annotated[float, Meta(ge=0.0, le=10.0, description="s; it stands on older poses of the leader")] = 0.5
    hand_over: Annotated[
        bool,
        Meta(description="whether the line may be led from its other end where its head is stuck; law trail"),
    ] = True
    on_leader_lost: Annotated[
        OnLeaderLost, Meta(description="what it does when a robot in front is gone, see below")
    ] = "relink"
    takeover_behavior: Annotated[
        Successor, Meta(description="what it does as the new head; same: what the lost one did, else avoid")
    ] = "same"
