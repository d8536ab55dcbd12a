/* Random numbers that depend on counters alone. */
#include "kernels.h"

void hash_counters(const uint64_t *states, int64_t count, int64_t many, uint64_t *out)
{
    for (int64_t i = 0; i < count; i++)
        for (int64_t k = 1; k <= many; k++) {
            uint64_t z = states[i] + (uint64_t)k * 0x9E3779B97F4A7C15u;
            z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9u;
            z = (z ^ z >> 27) * 0x94D049BB133111EBu;
            *out++ = z ^ z >> 31;
        }
}
