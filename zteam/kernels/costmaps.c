/* Grids of costs: distances to obstacles, inflation, what beams clear, and what outlines touch. */
#include <math.h>
#include <string.h>
#include "polygons.h"
#include "sines.h"

#define LEAST(a, b) ((a) < (b) ? (a) : (b))
#define MOST(a, b) ((a) > (b) ? (a) : (b))
enum { LETHAL = 254, UNKNOWN = 255 }; /* zteam.navigation.planning.costmap */
#define MARGIN 0.05 /* cells that an outline keeps from lethal ones, for what happens between two poses */
#define FAR 1e9     /* cells; what is farther away, or not a number, is outside of every grid */

/* Find the squared distance to the nearest lethal cell, at most (reach + 1)^2, for each cell of the window, and, with
   a table of their costs, raise the cell to its cost; one without information gets a cost from `unknown_from` on.
   Two passes along the columns give the distance within the column; a third one takes, along the row, the least of its
   square and that of the way there (Felzenszwalb and Huttenlocher 2012, by brute force: that is vector code). */
void inflate(const uint8_t *costs, int64_t rows, int64_t columns, const int64_t *window, int64_t reach,
             uint8_t *restrict steps, uint16_t *restrict line, uint16_t *restrict squares, const uint8_t *table,
             int64_t unknown_from, uint8_t *restrict out)
{
    const int64_t r0 = window[0], r1 = window[1], c0 = window[2], c1 = window[3];
    const int64_t low = MOST(r0 - reach, 0), high = LEAST(r1 + reach, rows);
    /* Column 0 of `steps` and `line` is column c0 - reach of the grid, whether it has that one or not. */
    const int64_t left = MOST(c0 - reach, 0), inner = LEAST(c1 + reach, columns) - left, count = c1 - c0;
    const int64_t width = count + 2 * reach, shift = left - (c0 - reach);
    const uint8_t cap = (uint8_t)(reach + 1);
    if (count == 0 || r0 == r1)
        return;
    /* A row more stands for what is beyond the first one and the last one. */
    memset(steps, cap, (size_t)((high - low + 1) * width));
    for (int64_t y = low; y < high; y++) {
        const uint8_t *restrict row = costs + y * columns + left;
        uint8_t *restrict here = steps + (y - low) * width + shift;
        const uint8_t *restrict above = y > low ? here - width : steps + (high - low) * width;
        for (int64_t x = 0; x < inner; x++) {
            const uint8_t further = above[x] < cap ? (uint8_t)(above[x] + 1) : cap;
            here[x] = row[x] == LETHAL ? 0 : further;
        }
    }
    for (int64_t y = high - low - 1; y >= 0; y--) {
        uint8_t *restrict here = steps + y * width;
        const uint8_t *restrict below = here + width;
        for (int64_t x = 0; x < width; x++) {
            const uint8_t further = below[x] < cap ? (uint8_t)(below[x] + 1) : cap;
            here[x] = LEAST(further, here[x]);
        }
    }
    for (int64_t y = r0; y < r1; y++) {
        uint16_t *restrict least = squares + (y - r0) * count;
        const uint8_t *restrict step = steps + (y - low) * width;
        for (int64_t x = 0; x < width; x++)
            line[x] = (uint16_t)(step[x] * step[x]);
        memcpy(least, line + reach, (size_t)count * sizeof *least);
        for (int64_t k = 1; k <= reach; k++) {
            const uint16_t *before = line + reach - k, *after = line + reach + k, way = (uint16_t)(k * k);
            for (int64_t x = 0; x < count; x++) {
                const uint16_t near = (uint16_t)(LEAST(before[x], after[x]) + way);
                least[x] = LEAST(near, least[x]);
            }
        }
        for (int64_t x = 0; table && x < count; x++) {
            const uint8_t cost = table[least[x]], here = costs[y * columns + c0 + x];
            out[y * columns + c0 + x] = (here == UNKNOWN ? cost >= unknown_from : cost > here) ? cost : here;
        }
    }
}

/* Clear the cells on each beam (Bresenham 1965) from column x0 and row y0 to its end, then mark those in `marks`. */
static void trace_beams(uint8_t *costs, int64_t rows, int64_t columns, int64_t x0, int64_t y0, const int64_t *ends,
                        int64_t count, const int64_t *marks, int64_t marked)
{
    for (int64_t beam = 0; beam < count; beam++) {
        const int64_t dx = ends[2 * beam] - x0, dy = ends[2 * beam + 1] - y0, across = MOST(dx, -dx);
        const int64_t along = MOST(dy, -dy), longest = MOST(across, along);
        for (int64_t step = 0, x = x0, y = y0, sum_x = longest, sum_y = longest; step <= longest; step++) {
            if (0 <= x && x < columns && 0 <= y && y < rows)
                costs[y * columns + x] = 0;
            sum_x += 2 * across;
            sum_y += 2 * along;
            if (sum_x >= 2 * longest)
                sum_x -= 2 * longest, x += dx > 0 ? 1 : -1;
            if (sum_y >= 2 * longest)
                sum_y -= 2 * longest, y += dy > 0 ? 1 : -1;
        }
    }
    for (int64_t i = 0; i < marked; i++) {
        const int64_t x = marks[2 * i], y = marks[2 * i + 1];
        if (0 <= x && x < columns && 0 <= y && y < rows)
            costs[y * columns + x] = LETHAL;
    }
}

/* The cell (column, row) of a point, and what it adds to a box of rows and columns, from and to. Return whether it is
   near enough. */
static int note_cell(const grid_frame *f, double x, double y, int64_t *cell, int64_t *box)
{
    const double dx = x - f->x, dy = y - f->y;
    const double u = floor((f->cosine * dx + f->sine * dy) / f->cell), v = floor((f->cosine * dy - f->sine * dx) / f->cell);
    if (!(fabs(u) < FAR && fabs(v) < FAR))
        return 0;
    cell[0] = (int64_t)u, cell[1] = (int64_t)v;
    box[0] = LEAST(box[0], cell[1]), box[1] = MOST(box[1], cell[1] + 1);
    box[2] = LEAST(box[2], cell[0]), box[3] = MOST(box[3], cell[0] + 1);
    return 1;
}

/* Clear and mark cells as the beams of a laser (x, y) say, which end at points (count, 2) and met something there or not.
   `mates` (mate_count, 3: x, y, radius): what is met on them is not marked. `limits`: metres up to which a beam clears,
   and marks, and that a mark is behind what was met. `cells` has room for 4 * count. Write the box of the cells; return
   whether all are near enough. */
int observe(uint8_t *costs, int64_t rows, int64_t columns, const grid_frame *f, const double *laser, const double *points,
            const uint8_t *met, int64_t count, const double *mates, int64_t mate_count, const double *limits,
            int64_t *cells, int64_t *box)
{
    int64_t origin[2], *marks = cells + 2 * count, marked = 0;
    box[0] = box[2] = INT64_MAX, box[1] = box[3] = INT64_MIN;
    if (!note_cell(f, laser[0], laser[1], origin, box))
        return 0;
    for (int64_t i = 0; i < count; i++) {
        const double x = points[2 * i], y = points[2 * i + 1], dx = x - laser[0], dy = y - laser[1];
        const double length = sqrt(dx * dx + dy * dy), least = MOST(length, 1e-9), share = LEAST(limits[0] / least, 1.0);
        int marks_it = met[i] && length <= limits[1];
        if (!note_cell(f, laser[0] + dx * share, laser[1] + dy * share, cells + 2 * i, box))
            return 0;
        for (int64_t k = 0; marks_it && k < mate_count; k++) {
            const double *mate = mates + 3 * k, away_x = x - mate[0], away_y = y - mate[1];
            marks_it = sqrt(away_x * away_x + away_y * away_y) > mate[2];
        }
        if (marks_it && !note_cell(f, x + dx * (limits[2] / least), y + dy * (limits[2] / least), marks + 2 * marked++, box))
            return 0;
    }
    trace_beams(costs, rows, columns, origin[0], origin[1], cells, count, marks, marked);
    return 1;
}

/* Set the cells that a disc touches to a cost; its middle (column, row) and its radius are in cells. */
void fill_disc(uint8_t *costs, int64_t rows, int64_t columns, double u, double v, double reach, uint8_t cost)
{
    if (!(fabs(u) < FAR && fabs(v) < FAR && reach >= 0.0 && reach < FAR))
        return;
    const int64_t top = LEAST((int64_t)floor(v + reach) + 1, rows), right = LEAST((int64_t)floor(u + reach) + 1, columns);
    for (int64_t row = MOST((int64_t)floor(v - reach), 0); row < top; row++)
        for (int64_t column = MOST((int64_t)floor(u - reach), 0); column < right; column++) {
            /* The point of the cell that is nearest to the middle of the disc. */
            const double du = MOST(MOST((double)column - u, u - (double)(column + 1)), 0.0);
            const double dv = MOST(MOST((double)row - v, v - (double)(row + 1)), 0.0);
            if (du * du + dv * dv <= reach * reach)
                costs[row * columns + column] = cost;
        }
}

/* Set the cells whose middle lies in an outline (count, 2: x, y), by the even-odd rule, to a cost. The outline is that of
   a base at a pose; `corners` has room for it in cells. Write the box of cells that it may touch, in the grid: rows and
   columns, from and to. Return whether there are any. */
int fill_outline(uint8_t *costs, int64_t rows, int64_t columns, const grid_frame *f, const double *outline, int64_t count,
                 const double *pose, uint8_t cost, double *corners, int64_t *box)
{
    double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY}, cosine, sine;
    cosine_sine(pose[2], &cosine, &sine);
    for (int64_t i = 0; i < 2 * count; i += 2) {
        const double dx = pose[0] + cosine * outline[i] - sine * outline[i + 1] - f->x;
        const double dy = pose[1] + sine * outline[i] + cosine * outline[i + 1] - f->y;
        corners[i] = (f->cosine * dx + f->sine * dy) / f->cell, corners[i + 1] = (f->cosine * dy - f->sine * dx) / f->cell;
        if (!(fabs(corners[i]) < FAR && fabs(corners[i + 1]) < FAR))
            return 0;
        for (int axis = 0; axis < 2; axis++)
            low[axis] = LEAST(corners[i + axis], low[axis]), high[axis] = MOST(corners[i + axis], high[axis]);
    }
    if (count == 0)
        return 0;
    box[0] = MOST((int64_t)floor(low[1]), 0), box[1] = LEAST((int64_t)floor(high[1]) + 1, rows);
    box[2] = MOST((int64_t)floor(low[0]), 0), box[3] = LEAST((int64_t)floor(high[0]) + 1, columns);
    for (int64_t row = box[0]; row < box[1]; row++)
        for (int64_t column = box[2]; column < box[3]; column++) {
            const double x = (double)column + 0.5, y = (double)row + 0.5;
            int is_inside = 0;
            for (int64_t i = 0, j = count - 1; i < count; j = i++) {
                const double *a = corners + 2 * i, *b = corners + 2 * j;
                if ((a[1] > y) != (b[1] > y) && x < a[0] + (y - a[1]) * (b[0] - a[0]) / (b[1] - a[1]))
                    is_inside = !is_inside;
            }
            if (is_inside)
                costs[row * columns + column] = cost;
        }
    return box[0] < box[1] && box[2] < box[3];
}

/* Find the first step at which an outline touches a lethal cell that it does not touch at the start; -1 if none.
   With 0 steps: 0 if it touches one where it stands. `points` has room for the outline twice, at the start and now. */
int64_t find_hit(const uint8_t *costs, int64_t rows, int64_t columns, const double *corners, int64_t count, double x,
                 double y, double yaw, const double *motion, int64_t steps, double *points)
{
    const double *start_x = points, *start_y = points + count;
    for (int64_t step = 0; step <= steps; step++) {
        double cosine, sine, low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
        if (step > 0) {
            /* The middle of the step's arc tells its direction. */
            cosine_sine(yaw + 0.5 * motion[2], &cosine, &sine);
            x += cosine * motion[0] - sine * motion[1];
            y += sine * motion[0] + cosine * motion[1];
            yaw += motion[2];
        }
        double *now_x = points + (step > 0 ? 2 * count : 0), *now_y = now_x + count;
        cosine_sine(yaw, &cosine, &sine);
        for (int64_t i = 0; i < count; i++) {
            now_x[i] = x + cosine * corners[2 * i] - sine * corners[2 * i + 1];
            now_y[i] = y + sine * corners[2 * i] + cosine * corners[2 * i + 1];
            if (!(fabs(now_x[i]) < FAR && fabs(now_y[i]) < FAR))
                return step;
            low[0] = LEAST(now_x[i], low[0]), high[0] = MOST(now_x[i], high[0]);
            low[1] = LEAST(now_y[i], low[1]), high[1] = MOST(now_y[i], high[1]);
        }
        if (step == 0 && steps > 0)
            continue;
        const int64_t top = (int64_t)floor(high[1] + MARGIN), right = (int64_t)floor(high[0] + MARGIN);
        for (int64_t row = (int64_t)floor(low[1] - MARGIN); row <= top; row++)
            for (int64_t column = (int64_t)floor(low[0] - MARGIN); column <= right; column++) {
                const int is_inside = 0 <= row && row < rows && 0 <= column && column < columns;
                const double u = (double)column, v = (double)row;
                if ((is_inside && costs[row * columns + column] != LETHAL)
                    || !meets_cell(now_x, now_y, count, u, v, step > 0 ? MARGIN : 0.0, 1))
                    continue;
                /* Near at the start already: then it may come nearer, but not touch it, unless it did. */
                if (step == 0 || !meets_cell(start_x, start_y, count, u, v, MARGIN, 1)
                    || (meets_cell(now_x, now_y, count, u, v, 0.0, 1)
                        && !meets_cell(start_x, start_y, count, u, v, 0.0, 1)))
                    return step;
            }
    }
    return -1;
}
