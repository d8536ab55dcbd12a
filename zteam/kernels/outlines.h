/* The hull of an outline: half-planes, each an outward normal of length 1 and an offset. */
#ifndef ZTEAM_OUTLINES_H
#define ZTEAM_OUTLINES_H

#include <math.h>
#include <stdint.h>

/* How far a point is outside of the hull: the largest of its distances from the half-planes. */
static inline double depth_of(double x, double y, const double *planes, int64_t sides)
{
    double depth = -INFINITY;
    for (int64_t i = 0; i < sides; i++) {
        double beyond = planes[3 * i] * x + planes[3 * i + 1] * y - planes[3 * i + 2];
        depth = beyond > depth ? beyond : depth;
    }
    return depth;
}

#endif
