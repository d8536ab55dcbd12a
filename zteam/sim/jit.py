"""The simulator's kernels: a set of their own (`zteam.compiling.kernels`)."""

from zteam.compiling.kernels import External, KernelSet, plainly

__all__ = ["SIMULATOR", "External", "compiled", "plainly", "unlocked", "use_compiled", "use_plain", "vectorized"]

SIMULATOR = KernelSet(
    "sim",
    warmup="zteam.sim.jit_warmup",
    log="zteam.sim",
    title="the simulator's kernels",
    on_numpy="lasers run on numpy, 10 to 100 times slower",
)

compiled, vectorized, unlocked = SIMULATOR.compiled, SIMULATOR.vectorized, SIMULATOR.unlocked
use_plain, use_compiled = SIMULATOR.use_plain, SIMULATOR.use_compiled
