/* Sine and cosine with the same bits on every processor: the C library's differ from system to system. */
#ifndef ZTEAM_SINES_H
#define ZTEAM_SINES_H

#include <math.h>

#define PI 3.141592653589793
#define TAU 6.283185307179586

/* Taylor's series about the nearest multiple of pi: the error is below 1e-15 + 2e-16 |angle|. */
static inline void cosine_sine(double angle, double *cosine, double *sine)
{
    double half_turns = rint(angle * (1.0 / PI));
    double rest = angle - half_turns * PI, x = rest * rest;
    double sign = 1.0 - 2.0 * fabs(half_turns - 2.0 * rint(0.5 * half_turns));
    double odd = -1.0 / 39916800.0
        + x * (1.0 / 6227020800.0 + x * (-1.0 / 1307674368000.0
        + x * (1.0 / 355687428096000.0 + x * (-1.0 / 121645100408832000.0 + x * (1.0 / 51090942171709440000.0)))));
    double even = -1.0 / 3628800.0
        + x * (1.0 / 479001600.0 + x * (-1.0 / 87178291200.0
        + x * (1.0 / 20922789888000.0 + x * (-1.0 / 6402373705728000.0 + x * (1.0 / 2432902008176640000.0)))));
    odd = 1.0 + x * (-1.0 / 6.0 + x * (1.0 / 120.0 + x * (-1.0 / 5040.0 + x * (1.0 / 362880.0 + x * odd))));
    even = 1.0 + x * (-1.0 / 2.0 + x * (1.0 / 24.0 + x * (-1.0 / 720.0 + x * (1.0 / 40320.0 + x * even))));
    *cosine = sign * even;
    *sine = sign * (rest * odd);
}

#endif
