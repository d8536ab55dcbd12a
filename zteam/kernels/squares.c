/* Rays against a bitmap: they leap from empty square to empty square (docs/benchmarks.md).
   This file is compiled twice for x86-64: once for every processor, once for those with AVX2. The bits are the same. */
#include "kernels.h"
#include "sines.h"

#ifdef __AVX2__
#define cast_squares cast_squares_avx2
#endif

enum {
    LANES = 64, /* beams that advance together, so that the loops over them become vector code */
    GROUP = 16, /* lanes that rest together, once all of them have arrived */
    LONGEST = 254, /* side of a square */
};
/* Direction components are kept off zero, so that no division gives inf; 30 m away that is 30 nm. */
#define TINY 1e-9

/* All of a lane's state in one object: the compiler can prove that the arrays do not touch each other. */
typedef struct {
    _Alignas(64) double ox[LANES]; /* origin in cells, mirrored so that the ray runs towards larger x and y */
    double oy[LANES], dx[LANES], dy[LANES]; /* direction, cells a metre */
    double ux[LANES], uy[LANES];            /* its inverse */
    double ix[LANES], iy[LANES];            /* the cell at which the lane is */
    double t[LANES];                        /* metres so far */
    double base[LANES];                     /* where the field of the ray's quadrant begins */
    int32_t place[LANES], side[LANES];      /* of the square that is empty from the cell on; 0: it has arrived */
    int32_t moves[LANES / GROUP];           /* whether a lane of the group is under way */
} lanes;

/* Find the side of the square at every lane: 0 in an occupied cell, and where the lane is parked. */
static int look(lanes *l, const uint8_t *sides, double columns)
{
    int moving = 0;
    for (int i = 0; i < LANES; i++)
        l->place[i] = (int32_t)(l->base[i] + l->iy[i] * columns + l->ix[i]);
    for (int group = 0; group < LANES / GROUP; group++) {
        int some = 0;
        for (int i = group * GROUP; i < (group + 1) * GROUP; i++) {
            l->side[i] = sides[(uint32_t)l->place[i]];
            some |= l->side[i];
        }
        l->moves[group] = some;
        moving |= some;
    }
    return moving;
}

/* Leap until every lane stands in an occupied cell or is parked. */
static void advance(lanes *l, const uint8_t *sides, double rows, double columns, double limit)
{
    const double park = rows * columns;
    while (look(l, sides, columns))
        for (int group = 0; group < LANES / GROUP; group++) {
            if (!l->moves[group])
                continue;
            for (int i = group * GROUP; i < (group + 1) * GROUP; i++) {
                double side = l->side[i], ix = l->ix[i], iy = l->iy[i];
                double edge_x = ix + side, edge_y = iy + side;
                double tx = (edge_x - l->ox[i]) * l->ux[i], ty = (edge_y - l->oy[i]) * l->uy[i];
                int by_x = tx <= ty;
                double t = by_x ? tx : ty;
                /* Where the other coordinate has got to; rounding must not carry it out of the square. */
                double along_x = floor(l->ox[i] + t * l->dx[i]), along_y = floor(l->oy[i] + t * l->dy[i]);
                along_x = along_x > ix ? along_x : ix;
                along_x = along_x < edge_x - 1.0 ? along_x : edge_x - 1.0;
                along_y = along_y > iy ? along_y : iy;
                along_y = along_y < edge_y - 1.0 ? along_y : edge_y - 1.0;
                double next_x = by_x ? edge_x : along_x, next_y = by_x ? along_y : edge_y;
                int gone = (next_x >= columns) | (next_y >= rows) | (t >= limit), goes = side > 0.0;
                next_x = gone ? park : next_x;
                next_y = gone ? 0.0 : next_y;
                t = gone ? limit : t;
                l->ix[i] = goes ? next_x : ix;
                l->iy[i] = goes ? next_y : iy;
                l->t[i] = goes ? t : l->t[i];
            }
        }
}

/* Bring lanes that start outside the bitmap to where they enter it; park those that never do. */
static void enter(lanes *l, double rows, double columns, double limit)
{
    for (int i = 0; i < LANES; i++) {
        double qx = l->ox[i], qy = l->oy[i], dx = l->dx[i], dy = l->dy[i];
        /* On the far outer face itself the cell is the outermost one. */
        double jx = l->ix[i] < 0.0 && qx >= 0.0 ? 0.0 : l->ix[i], jy = l->iy[i] < 0.0 && qy >= 0.0 ? 0.0 : l->iy[i];
        double tx = -qx / dx, ty = -qy / dy, t = tx > ty ? tx : ty;
        t = t > 0.0 ? t : 0.0;
        if (t > 0.0) {
            jx = tx > ty ? 0.0 : floor(qx + t * dx);
            jy = tx > ty ? floor(qy + t * dy) : 0.0;
        }
        int misses = !(jx >= 0.0 && jy >= 0.0 && jx < columns && jy < rows && t < limit);
        l->ix[i] = misses ? rows * columns : jx;
        l->iy[i] = misses ? 0.0 : jy;
        l->t[i] = misses ? limit : t;
    }
}

/* Shorten the ranges of a block of beams of one scan, which starts at px, py in cells with these direction factors. */
static void cast_block(
    const bitmap *map, double px, double py, const double turn[4], const double *cosines, const double *sines,
    int count, double limit, int32_t mark, double *ranges, int32_t *hits)
{
    lanes l;
    double cosine[LANES], sine[LANES];
    const double columns = map->columns, rows = map->rows, stride = rows * columns + 1.0;
    const double jx = floor(px), jy = floor(py);
    for (int i = 0; i < LANES; i++) {
        cosine[i] = i < count ? cosines[i] : 1.0;
        sine[i] = i < count ? sines[i] : 0.0;
    }
    for (int i = 0; i < LANES; i++) {
        double dx = turn[0] * cosine[i] - turn[1] * sine[i], dy = turn[2] * cosine[i] + turn[3] * sine[i];
        int left = dx < 0.0, down = dy < 0.0;
        /* The fields are mirrored by quadrant, so that every ray runs towards larger x and y. */
        l.ox[i] = left ? columns - px : px;
        l.ix[i] = left ? columns - 1.0 - jx : jx;
        l.oy[i] = down ? rows - py : py;
        l.iy[i] = down ? rows - 1.0 - jy : jy;
        l.base[i] = (left ? stride : 0.0) + (down ? 2.0 * stride : 0.0);
        dx = fabs(dx), dy = fabs(dy);
        l.dx[i] = dx = dx > TINY ? dx : TINY;
        l.dy[i] = dy = dy > TINY ? dy : TINY;
        l.ux[i] = 1.0 / dx;
        l.uy[i] = 1.0 / dy;
        l.t[i] = 0.0;
    }
    for (int i = count; i < LANES; i++)
        l.ix[i] = rows * columns, l.iy[i] = 0.0;
    if (!(px >= 0.0 && px < columns && py >= 0.0 && py < rows))
        enter(&l, rows, columns, limit);
    advance(&l, map->sides, rows, columns, limit);
    for (int i = 0; i < count; i++) {
        int nearer = l.t[i] < ranges[i];
        ranges[i] = nearer ? l.t[i] : ranges[i];
        hits[i] = nearer ? mark : hits[i];
    }
}

void cast_squares(const bitmap *map, const fans *s, int32_t mark)
{
    double cosine, sine;
    cosine_sine(map->yaw, &cosine, &sine);
    for (int64_t scan = 0; scan < s->count; scan++) {
        double dx = s->at[scan] - map->x, dy = s->at[s->count + scan] - map->y, c, w;
        double px = (cosine * dx + sine * dy) / map->cell_x, py = (cosine * dy - sine * dx) / map->cell_y;
        cosine_sine(s->at[2 * s->count + scan] - map->yaw, &c, &w);
        if (!(map->z_min <= s->z[scan] && s->z[scan] <= map->z_max) || !isfinite(px + py + c + w))
            continue;
        const double turn[4] = {c / map->cell_x, w / map->cell_x, w / map->cell_y, c / map->cell_y};
        int64_t row = scan * s->beams, table = s->tables > 1 ? row : 0;
        for (int64_t first = 0; first < s->beams; first += LANES) {
            int count = s->beams - first < LANES ? (int)(s->beams - first) : LANES;
            cast_block(map, px, py, turn, s->cosine + table + first, s->sine + table + first, count, s->limit, mark,
                       s->ranges + row + first, s->hits + row + first);
        }
    }
}

#ifndef __AVX2__
/* The largest empty square that begins at each cell: one larger than the smallest of its three neighbours'. One pass
   from the far corner; beyond the bitmap all is free. Sides are bytes: a larger square is left in several leaps. */
void fill_squares(const uint8_t *free_cells, int64_t rows, int64_t columns, uint8_t *out)
{
    for (int64_t y = rows - 1; y >= 0; y--)
        for (int64_t x = columns - 1; x >= 0; x--) {
            uint8_t *here = out + y * columns + x;
            int right = x + 1 < columns ? here[1] : LONGEST, above = y + 1 < rows ? here[columns] : LONGEST;
            int corner = x + 1 < columns && y + 1 < rows ? here[columns + 1] : LONGEST;
            int side = right < above ? right : above;
            side = (corner < side ? corner : side) + 1;
            *here = (uint8_t)(!free_cells[y * columns + x] ? 0 : side < LONGEST ? side : LONGEST);
        }
}

#ifdef __x86_64__
#include <cpuid.h>

int has_avx2(void)
{
    unsigned a, b, c, d, low, high;
    /* The processor has it, and the system keeps the registers: __builtin_cpu_supports says no under zig. */
    if (!__get_cpuid(1, &a, &b, &c, &d) || !(c >> 27 & 1))
        return 0;
    __asm__("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
    return (low & 6) == 6 && __get_cpuid_count(7, 0, &a, &b, &c, &d) && b >> 5 & 1;
}
#else
int has_avx2(void)
{
    return 0;
}
#endif
#endif
