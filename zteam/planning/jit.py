"""The kernels of navigation: a set of their own (`zteam.compiling.kernels`)."""

from zteam.compiling.kernels import KernelSet, plainly

__all__ = ["PLANNING", "compiled", "plainly", "use_compiled", "use_plain", "vectorized"]

PLANNING = KernelSet(
    "planning",
    warmup="zteam.planning.jit_warmup",
    log="zteam.planning",
    title="the kernels of navigation",
    on_numpy="navigation runs on numpy, 10 to 100 times slower",
)

compiled, vectorized = PLANNING.compiled, PLANNING.vectorized
use_plain, use_compiled = PLANNING.use_plain, PLANNING.use_compiled
