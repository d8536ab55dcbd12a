/* What Python calls. It reads this file: lines that begin with # are for C alone. Checks are in binding.py. */
#ifndef ZTEAM_KERNELS_H
#define ZTEAM_KERNELS_H
#include <stdint.h>

/* A bitmap for rays: the largest empty square at every cell, for each quadrant (zteam.sim.fields). */
typedef struct {
    const uint8_t *sides; /* (4, rows * columns + 1) */
    int64_t rows, columns;
    double cell_x, cell_y;            /* metres */
    double x, y, yaw, cosine, sine;   /* of its lower left corner in `map` */
    double z_min, z_max;              /* heights that see it */
} bitmap;

/* Scans of one kind, and where their sensors are. */
typedef struct {
    int64_t count, beams;
    double *x, *y, *yaw;      /* (count), in `map` */
    const double *z;          /* (count) */
    const int64_t *owner;     /* (count): the mover that carries the sensor and that it does not see, or -1 */
    int64_t tables;           /* rows of the next two: 1 for all scans, or one for each */
    const double *cosine, *sine; /* (tables, beams): directions in the sensor's frame */
    double angle_min, increment, jitter, limit;
    double *ranges;           /* (count, beams), metres */
    int32_t *hits;            /* (count, beams) */
    double *tops;             /* room for a number for every 8 beams */
} scans;

/* squares.c: rays against a bitmap */
int has_avx2(void);
void cast_squares(const bitmap *map, const scans *s, int32_t mark);
void cast_squares_avx2(const bitmap *map, const scans *s, int32_t mark);

/* costmaps.c: grids of costs */

/* search.c: ways over grids of weights */

/* particles.c: localisation */

/* safety.c: what a base meets */

#endif
