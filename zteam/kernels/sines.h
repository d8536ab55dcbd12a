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

/* The angle of a direction in [-pi, pi], wrong by less than 1e-15; 0 of no direction. Three half angles, then Taylor. */
static inline double angle_of(double x, double y)
{
    double away = sqrt(x * x + y * y), half = away > 0.0 ? fabs(y) / (away + fabs(x)) : 0.0;
    double quarter = half / (1.0 + sqrt(1.0 + half * half)), t = quarter / (1.0 + sqrt(1.0 + quarter * quarter));
    double u = t * t;
    double rest = 1.0 / 13.0 - u * (1.0 / 15.0 - u * (1.0 / 17.0 - u * (1.0 / 19.0 - u * (1.0 / 21.0))));
    rest = 1.0 / 3.0 - u * (1.0 / 5.0 - u * (1.0 / 7.0 - u * (1.0 / 9.0 - u * (1.0 / 11.0 - u * rest))));
    double angle = 8.0 * (t - t * u * rest);
    angle = x < 0.0 ? PI - angle : angle;
    return y < 0.0 ? -angle : angle;
}

#endif
