/* What Python calls. It reads this file: lines that begin with # are for C alone. Checks are in binding.py. */
#ifndef ZTEAM_KERNELS_H
#define ZTEAM_KERNELS_H
#include <stdint.h>

/* A bitmap: the largest empty square at every cell, for each quadrant of directions (zteam.sim.fields). */
typedef struct {
    const uint8_t *sides; /* (4, rows * columns + 1) */
    int64_t rows, columns;
    double cell_x, cell_y; /* metres */
    double x, y, yaw;      /* of its lower left corner in `map` */
    double z_min, z_max;   /* metres: what is between meets it */
} bitmap;

/* Rays that fan out from sensors of one kind. */
typedef struct {
    int64_t count, beams;
    const double *x, *y, *z, *yaw; /* (count), in `map` */
    const int64_t *owner;          /* (count): the mover that carries the sensor and that it does not see, or -1 */
    int64_t tables;                /* rows of the next two: 1 for all scans, or one for each */
    const double *cosine, *sine;   /* (tables, beams): directions in the sensor's frame */
    double angle_min, increment;   /* radians */
    double jitter;                 /* increments that a beam may be off its place */
    double limit;                  /* metres */
    double *ranges;                /* (count, beams), metres */
    int32_t *hits;                 /* (count, beams): what was met */
    double *tops;                  /* room for a number for every 8 beams */
} fans;

/* Polygons in groups that move together; groups are sorted into bins by their centres. */
typedef struct {
    int32_t shapes, groups, movers;
    const double *local_x, *local_y; /* (vertices), in the mover's frame; in `map` for what stands still */
    double *x, *y;                   /* (vertices), in `map` */
    const int32_t *first_vertex;     /* (shapes + 1) */
    const double *z_min, *z_max;     /* (shapes), metres */
    const int32_t *first_shape;      /* (groups + 1) */
    const int64_t *owner;            /* (groups): the mover, or -1 for what stands still */
    const double *local_centre;      /* (groups, 2) */
    double *centre_x, *centre_y;     /* (groups), in `map` */
    const double *radius;            /* (groups): of the circle about the centre that holds all shapes */
    int32_t *in_bin;                 /* (groups), in the order of their bins */
    int32_t *bin_start;              /* (64 * 64 + 2): bins row by row, then one for groups that are wider than a bin */
    int32_t columns, rows;           /* bins along x and y */
    double bin_x, bin_y, bin_size;   /* metres */
    double reach;                    /* the largest radius of a group in a bin */
    double *corner_x, *corner_y;     /* room for the corners of a shape */
} polygons;

/* squares.c: rays against a bitmap */
int has_avx2(void);
void fill_squares(const uint8_t *free_cells, int64_t rows, int64_t columns, uint8_t *out);
void cast_cells(const bitmap *map, const fans *s, int32_t mark);
void cast_squares(const bitmap *map, const fans *s, int32_t mark);
void cast_squares_avx2(const bitmap *map, const fans *s, int32_t mark);

/* edges.c: rays against polygons */
void cast_edges(const polygons *o, const fans *all);

/* bodies.c: what moves, and what it meets */
void move_polygons(polygons *o, const double *poses);
void find_overlaps(const polygons *o, const bitmap *maps, int64_t count, int apart, uint8_t *found);
void move_all(polygons *o, const bitmap *maps, int64_t count, int64_t robots, double *poses, const double *ends,
              uint8_t *blocked);
void hold(polygons *o, const bitmap *maps, int64_t count, const double *half, const double *poses, double *ends,
          const uint8_t *suspects, const uint8_t *tangled, int apart, double *places, double *shares);
void follow(int64_t robots, const double *poses, const double *velocity, double seconds, int tangents, double *ends);
void measure(int64_t robots, const double *before, const double *after, double seconds, int tangents,
             double *velocity);

/* costmaps.c: grids of costs */

/* search.c: ways over grids of weights */

/* particles.c: localisation */

/* safety.c: what a base meets */

#endif
