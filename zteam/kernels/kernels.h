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
void inflate(const uint8_t *costs, int64_t rows, int64_t columns, const int64_t *window, int64_t reach, uint8_t *steps,
             uint16_t *line, uint16_t *squares, const uint8_t *table, int64_t unknown_from, uint8_t *out);
void trace_beams(uint8_t *costs, int64_t rows, int64_t columns, int64_t x0, int64_t y0, const int64_t *ends,
                 int64_t count, const int64_t *marks, int64_t marked);
int64_t find_hit(const uint8_t *costs, int64_t rows, int64_t columns, const double *corners, int64_t count, double x,
                 double y, double yaw, const double *motion, int64_t steps, double *points);

/* search.c: ways over grids of weights */
void weigh_cells(const uint8_t *costs, int64_t rows, int64_t columns, int64_t neutral, int64_t factor, int64_t barred,
                 int64_t unknown, uint8_t *out);
int search(const uint8_t *weights, int64_t columns, int64_t start, int64_t goal, const int64_t *steps,
           uint32_t *costs, int64_t *box);
int64_t trace(const uint8_t *weights, int64_t columns, int64_t start, int64_t goal, const int64_t *steps,
              const uint32_t *costs, int64_t *out, int64_t room);
void measure_lines(const uint8_t *weights, int64_t columns, const int64_t *begins, const int64_t *ends, int64_t count,
                   double *out);
void shorten(const uint8_t *weights, int64_t columns, const int64_t *way, int64_t count, int64_t stride, int64_t reach,
             double least, double *best, int64_t *before);

/* A map's likelihoods, with a border of one cell, and where the map lies. */
typedef struct {
    const uint16_t *values; /* (rows, columns) */
    int64_t rows, columns;
    double x, y, yaw, cosine, sine, cell; /* its lower left corner in `map`, and metres a cell */
} likelihoods;

/* particles.c: localisation */
void move_poses(double *poses, int64_t count, const double *motion, const double *draws);
void sum_poses(const likelihoods *f, const double *poses, int64_t count, const float *beams, int64_t many, int64_t *out);
void climb(const likelihoods *f, double *poses, int64_t count, const float *beams, int64_t many, double step,
           double turn, int64_t halvings, int64_t most, int64_t *sums);
int64_t resample(const double *poses, const double *sums, int64_t count, const double *draws, const uint8_t *strange,
                 int64_t most, const int64_t *enough, int64_t limits, const double *size, int64_t *table, int64_t mask,
                 int64_t *guide, double *out);
void find_cluster(const double *poses, const double *weights, int64_t count, const double *size, int64_t turns,
                  int64_t *table, int64_t mask, int64_t *cluster, int64_t *stack, double *totals, int64_t *labels,
                  double *moments);

/* safety.c: what a base meets */

#endif
