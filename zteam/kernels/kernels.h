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

/* safety.c: what a base meets. Points are (2, count) or, with how far the base had travelled then, (3, count). */
/* Seconds until a base on an arc first comes nearer to a point in a disc (x, y, radius) than it may; inf: it does not. */
double meet(const double *points, int64_t count, const double *planes, int64_t sides, double speed_x, double speed_y,
            double turn, double seconds, double margin, double x, double y, double radius);
/* Tell points in the frame that is at this pose of theirs. */
void move_points(double *points, int64_t count, double x, double y, double turn);
/* Drop known points that a scan tells of, or that are far or old; add its hits, the nearest of every few; count them. */
int64_t see(const double *known, int64_t count, const double *axes, const double *distances, int64_t beams,
            double start, double step, int64_t few, double x, double y, double yaw, double far, double way,
            double oldest, double *seen);
/* Metres to the nearest hit in a corridor; it looks no further once a hit is nearer than enough. */
double look_along(const double *axes, const double *distances, int64_t beams, double half_width, double heading,
                  double enough);
/* The first of some headings whose corridor is clear for some reach, or -1. */
int64_t first_clear(const double *axes, const double *distances, int64_t beams, double half_width, double reach,
                    const double *headings, int64_t count);

#endif
