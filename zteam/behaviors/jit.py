"""The kernels of behaviours and of the safety layer: a set of their own (`zteam.compiling.kernels`).

On numpy a robot's step takes a third longer, no more. So these are compiled only where that is asked for.
"""

from zteam.compiling.kernels import KernelSet, plainly

__all__ = ["BEHAVIOR_KERNELS", "compiled", "plainly", "use_compiled", "use_plain"]

BEHAVIOR_KERNELS = KernelSet(
    "behaviors",
    warmup="zteam.behaviors.jit_warmup",
    log="zteam.behaviors",
    title="the robots' kernels",
    on_numpy="robots look at their scans with numpy, which takes a little longer",
    unasked=False,
)

compiled = BEHAVIOR_KERNELS.compiled
use_plain, use_compiled = BEHAVIOR_KERNELS.use_plain, BEHAVIOR_KERNELS.use_compiled
