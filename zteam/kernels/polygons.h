/* What kernels share: which groups of polygons are near a place, what is in a polygon, and what it meets. */
#ifndef ZTEAM_POLYGONS_H
#define ZTEAM_POLYGONS_H

#include <stddef.h>

#include "kernels.h"

/* A number cut to a whole one from 0 to `most`; 0 for what is no number. */
static inline int64_t clamped(double value, int64_t most)
{
    return value > 0.0 ? value < (double)most ? (int64_t)value : most : 0;
}

/* Row or column of the bin nearest to a coordinate. */
static inline int32_t bin_at(const polygons *o, double value, double origin, int32_t count)
{
    return (int32_t)clamped((value - origin) / o->bin_size, count - 1);
}

/* A walk through bins: row by row, and at last through the groups that are wider than a bin. */
typedef struct {
    int32_t row, last_row, first_column, last_column, slot, end;
} walk;

/* Begin a walk to all groups whose centre may be `reach` metres from a place, or nearer. */
static inline walk walk_near(const polygons *o, double x, double y, double reach)
{
    walk w = {bin_at(o, y - reach, o->bin_y, o->rows) - 1, bin_at(o, y + reach, o->bin_y, o->rows),
              bin_at(o, x - reach, o->bin_x, o->columns), bin_at(o, x + reach, o->bin_x, o->columns), 0, 0};
    return w;
}

/* The next group of a walk; -1 at its end. */
static inline int32_t next_group(const polygons *o, walk *w)
{
    while (w->slot == w->end) {
        if (w->row > w->last_row)
            return -1;
        int32_t first = ++w->row * o->columns + w->first_column, last = w->row * o->columns + w->last_column;
        if (w->row > w->last_row)
            first = last = o->rows * o->columns;
        w->slot = o->bin_start[first], w->end = o->bin_start[last + 1];
    }
    return o->in_bin[w->slot++];
}

/* Whether a point lies in the polygon of vertices `begin` to `end`, by the even-odd rule. */
static inline int contains(const double *px, const double *py, int64_t begin, int64_t end, double x, double y)
{
    int inside = 0;
    for (int64_t i = begin, j = end - 1; i < end; j = i++)
        if ((py[i] > y) != (py[j] > y) && x < px[i] + (y - py[i]) * (px[j] - px[i]) / (py[j] - py[i]))
            inside = !inside;
    return inside;
}

/* Whether a polygon in cells covers a part of a cell that is `margin` larger on each side; with `closed`, whether it
   touches it. An edge is clipped to the cell (Liang and Barsky 1984). */
static inline int meets_cell(
    const double *px, const double *py, int64_t count, double column, double row, double margin, int closed)
{
    const double low[2] = {column - margin, row - margin}, high[2] = {column + 1.0 + margin, row + 1.0 + margin};
    if (contains(px, py, 0, count, column + 0.5, row + 0.5))
        return 1;
    for (int64_t i = 0, j = count - 1; i < count; j = i++) {
        double first = 0.0, last = 1.0;
        for (int axis = 0; axis < 2; axis++) {
            const double start = axis ? py[j] : px[j], way = (axis ? py[i] : px[i]) - start;
            if (way == 0.0) {
                if (start < low[axis] || start > high[axis] || (!closed && (start == low[axis] || start == high[axis])))
                    last = -1.0;
                continue;
            }
            const double t = (low[axis] - start) / way, u = (high[axis] - start) / way;
            first = t < u ? t > first ? t : first : u > first ? u : first;
            last = t < u ? u < last ? u : last : t < last ? t : last;
        }
        if (closed ? first <= last : first < last)
            return 1;
    }
    return 0;
}

#endif
