/* Grids of costs: distances to obstacles, inflation, what beams clear, and what outlines touch; and places on paths. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "polygons.h"
#include "sines.h"

#define LEAST(a, b) ((a) < (b) ? (a) : (b))
#define MOST(a, b) ((a) > (b) ? (a) : (b))
enum { LETHAL = 254, UNKNOWN = 255 }; /* zteam.navigation.planning.costmap */
#define BEHIND 0.25 /* cells from the end of a beam to the point whose cell is marked */
#define MARGIN 0.05 /* cells that an outline keeps from lethal ones, for what happens between two poses */
#define FAR 1e9     /* cells; what is farther away, or not a number, is outside of every grid */
#define STEP 0.1    /* cells that no point of an outline moves more than from one looked-at pose to the next */

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
        /* Of most beams another one ends in the same cell. */
        if (beam > 0 && ends[2 * beam] == ends[2 * beam - 2] && ends[2 * beam + 1] == ends[2 * beam - 1])
            continue;
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

/* A point in cells: along the columns, along the rows. */
static inline void to_cells(const costmap *c, double x, double y, double *u, double *v)
{
    const double dx = x - c->x, dy = y - c->y;
    *u = (c->cosine * dx + c->sine * dy) / c->cell, *v = (c->cosine * dy - c->sine * dx) / c->cell;
}

/* The layers have changed in a box of cells: rows and columns, from and to. */
static void widen(costmap *c, int64_t low, int64_t high, int64_t left, int64_t right)
{
    c->changed[0] = LEAST(c->changed[0], low), c->changed[1] = MOST(c->changed[1], high);
    c->changed[2] = LEAST(c->changed[2], left), c->changed[3] = MOST(c->changed[3], right);
}

void change_all(costmap *c)
{
    widen(c, 0, c->rows, 0, c->columns);
}

void move_costmap(costmap *c, int64_t rows, int64_t columns)
{
    const int64_t height = c->rows, width = c->columns, aside = MOST(columns, -columns), kept = width - aside;
    for (int64_t k = 0; k < height; k++) {
        const int64_t row = rows < 0 ? height - 1 - k : k;
        uint8_t *to = c->seen + row * width;
        if (kept <= 0 || row + rows < 0 || row + rows >= height) {
            memset(to, UNKNOWN, (size_t)width);
            continue;
        }
        memmove(to + MOST(-columns, 0), c->seen + (row + rows) * width + MOST(columns, 0), (size_t)kept);
        memset(to + (columns > 0 ? kept : 0), UNKNOWN, (size_t)aside);
    }
    change_all(c);
}

/* The cell (column, row) of a point, and what it adds to a box. Return whether it is near enough. */
static int note_cell(const costmap *c, double x, double y, int64_t *cell, int64_t *box)
{
    double u, v;
    to_cells(c, x, y, &u, &v);
    if (!(fabs(u) < FAR && fabs(v) < FAR))
        return 0;
    cell[0] = (int64_t)floor(u), cell[1] = (int64_t)floor(v);
    box[0] = LEAST(box[0], cell[1]), box[1] = MOST(box[1], cell[1] + 1);
    box[2] = LEAST(box[2], cell[0]), box[3] = MOST(box[3], cell[0] + 1);
    return 1;
}

int observe(costmap *c, const planar_scan *s, const double *base, const double *mates, int64_t mate_count, double margin,
            const double *limits, double *ends, uint8_t *met, int64_t *cells)
{
    int64_t origin[2], box[4] = {INT64_MAX, INT64_MIN, INT64_MAX, INT64_MIN}, marked = 0;
    double laser[2];
    const int64_t count
        = find_ends(s, base, MOST(limits[0], limits[1]), s->beams, mates, mate_count, margin, laser, ends, met);
    int64_t *marks = cells + 2 * count;
    if (count == 0)
        return 1;
    if (!note_cell(c, laser[0], laser[1], origin, box))
        return 0;
    for (int64_t i = 0; i < count; i++) {
        const double x = ends[2 * i], y = ends[2 * i + 1], dx = x - laser[0], dy = y - laser[1];
        const double length = sqrt(dx * dx + dy * dy), least = MOST(length, 1e-9), share = LEAST(limits[0] / least, 1.0);
        if (!note_cell(c, laser[0] + dx * share, laser[1] + dy * share, cells + 2 * i, box))
            return 0;
        /* A beam ends on the surface, between two cells: what it has met is in the one behind. */
        const double behind = BEHIND * c->cell / least;
        if (met[i] && length <= limits[1]
            && !note_cell(c, x + dx * behind, y + dy * behind, marks + 2 * marked++, box))
            return 0;
    }
    trace_beams(c->seen, c->rows, c->columns, origin[0], origin[1], cells, count, marks, marked);
    widen(c, box[0], box[1], box[2], box[3]);
    return 1;
}

void clear_outline(costmap *c, const double *pose)
{
    double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY}, cosine, sine;
    double *u = c->room, *v = u + c->corners;
    cosine_sine(pose[2], &cosine, &sine);
    for (int64_t i = 0; i < c->corners; i++) {
        const double ahead = c->outline[2 * i], aside = c->outline[2 * i + 1];
        to_cells(c, pose[0] + cosine * ahead - sine * aside, pose[1] + sine * ahead + cosine * aside, u + i, v + i);
        if (!(fabs(u[i]) < FAR && fabs(v[i]) < FAR))
            return;
        low[0] = LEAST(u[i], low[0]), high[0] = MOST(u[i], high[0]);
        low[1] = LEAST(v[i], low[1]), high[1] = MOST(v[i], high[1]);
    }
    const int64_t bottom = MOST((int64_t)floor(low[1]), 0), top = LEAST((int64_t)floor(high[1]) + 1, c->rows);
    const int64_t left = MOST((int64_t)floor(low[0]), 0), right = LEAST((int64_t)floor(high[0]) + 1, c->columns);
    for (int64_t row = bottom; row < top; row++)
        for (int64_t column = left; column < right; column++)
            if (contains(u, v, 0, c->corners, (double)column + 0.5, (double)row + 0.5))
                c->seen[row * c->columns + column] = 0;
    if (bottom < top && left < right)
        widen(c, bottom, top, left, right);
}

/* Set the cells of a layer that a disc (x, y, radius) touches to a cost; without a layer, note that they change. */
static void fill_disc(costmap *c, uint8_t *layer, const double *disc, uint8_t cost)
{
    const double reach = disc[2] / c->cell;
    double u, v;
    to_cells(c, disc[0], disc[1], &u, &v);
    if (!(fabs(u) < FAR && fabs(v) < FAR && reach >= 0.0 && reach < FAR))
        return;
    const int64_t bottom = MOST((int64_t)floor(v - reach), 0), top = LEAST((int64_t)floor(v + reach) + 1, c->rows);
    const int64_t left = MOST((int64_t)floor(u - reach), 0), right = LEAST((int64_t)floor(u + reach) + 1, c->columns);
    for (int64_t row = bottom; layer && row < top; row++)
        for (int64_t column = left; column < right; column++) {
            /* The point of the cell that is nearest to the middle of the disc. */
            const double du = MOST(MOST((double)column - u, u - (double)(column + 1)), 0.0);
            const double dv = MOST(MOST((double)row - v, v - (double)(row + 1)), 0.0);
            if (du * du + dv * dv <= reach * reach)
                layer[row * c->columns + column] = cost;
        }
    if (bottom < top && left < right)
        widen(c, bottom, top, left, right);
}

void change_disc(costmap *c, const double *disc, int forget)
{
    fill_disc(c, forget ? c->seen : NULL, disc, UNKNOWN);
}

/* Make the changed box `more` cells wider on each side, and cut it to the grid. */
static void clip(const costmap *c, int64_t more, int64_t *box)
{
    for (int axis = 0; axis < 2; axis++) {
        const int64_t size = axis ? c->columns : c->rows;
        box[2 * axis] = MOST(LEAST(box[2 * axis] - more, size), 0);
        box[2 * axis + 1] = MOST(LEAST(box[2 * axis + 1] + more, size), box[2 * axis]);
    }
}

int update_costmap(costmap *c, const double *mates, int64_t mate_count, int64_t *box)
{
    const int64_t width = c->columns, reach = c->reach;
    memcpy(box, c->changed, sizeof c->changed);
    if (box[0] > box[1])
        return 0;
    clip(c, 0, box);
    for (int64_t row = box[0]; row < box[1]; row++)
        for (int64_t i = row * width + box[2]; i < row * width + box[3]; i++) {
            /* updateWithMax of Costmap2D: one more makes UNKNOWN the least. */
            const uint8_t below = (uint8_t)(c->fixed[i] + 1), above = (uint8_t)(c->seen[i] + 1);
            c->base[i] = (uint8_t)(MOST(below, above) - 1);
        }
    for (int64_t k = 0; k < mate_count; k++)
        fill_disc(c, c->base, mates + 3 * k, LETHAL);
    c->changed[0] = c->changed[2] = INT64_MAX, c->changed[1] = c->changed[3] = INT64_MIN;
    clip(c, reach, box);
    const int64_t high = box[1] - box[0], wide = box[3] - box[2];
    const size_t steps = (size_t)((high + 2 * reach + 2) * (wide + 2 * reach)), line = (size_t)(wide + 2 * reach);
    uint16_t *room = malloc((line + (size_t)(high * wide)) * sizeof *room + steps + 1);
    if (!room)
        return -1;
    inflate(c->base, c->rows, width, box, reach, (uint8_t *)(room + line + high * wide), room, room + line, c->table,
            c->unknown_from, c->costs);
    free(room);
    return 1;
}

int cost_at(const costmap *c, double x, double y)
{
    double u, v;
    to_cells(c, x, y, &u, &v);
    const int is_inside = u >= 0.0 && u < (double)c->columns && v >= 0.0 && v < (double)c->rows;
    return is_inside ? c->costs[(int64_t)v * c->columns + (int64_t)u] : LETHAL;
}

double time_to_collision(const costmap *c, const double *pose, const double *velocity, double duration)
{
    const double speed = sqrt(velocity[0] * velocity[0] + velocity[1] * velocity[1]) + fabs(velocity[2]) * c->radius;
    const double steps = -floor(-(speed * duration / (STEP * c->cell))), interval = duration / steps;
    const double ahead = velocity[0] / c->cell, aside = velocity[1] / c->cell;
    const double motion[3] = {ahead * interval, aside * interval, velocity[2] * interval};
    /* Nothing is touched where a cell costs less than it would so many cells from a lethal one. */
    const double wide = c->radius / c->cell + 1.5, far = wide * wide, last = (double)((c->reach + 1) * (c->reach + 1));
    const uint8_t near = far < last ? c->table[(int64_t)far + 1] : 0;
    double *start_x = c->room, *start_y = start_x + c->corners, x, y, yaw = pose[2] - c->yaw;
    /* No number, or more than could ever be looked at. */
    if (!(steps < FAR))
        return 0.0;
    if (steps == 0.0)
        return INFINITY;
    to_cells(c, pose[0], pose[1], &x, &y);
    for (double step = 0.0; step <= steps; step++) {
        double cosine, sine, low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
        if (step > 0.0) {
            /* The middle of the step's arc tells its direction. */
            cosine_sine(yaw + 0.5 * motion[2], &cosine, &sine);
            x += cosine * motion[0] - sine * motion[1];
            y += sine * motion[0] + cosine * motion[1];
            yaw += motion[2];
            if (x >= wide && x < (double)c->columns - wide && y >= wide && y < (double)c->rows - wide
                && c->costs[(int64_t)y * c->columns + (int64_t)x] < near)
                continue;
        }
        double *now_x = start_x + (step > 0.0 ? 2 * c->corners : 0), *now_y = now_x + c->corners;
        cosine_sine(yaw, &cosine, &sine);
        for (int64_t i = 0; i < c->corners; i++) {
            const double corner_x = c->outline[2 * i] / c->cell, corner_y = c->outline[2 * i + 1] / c->cell;
            now_x[i] = x + cosine * corner_x - sine * corner_y;
            now_y[i] = y + sine * corner_x + cosine * corner_y;
            if (!(fabs(now_x[i]) < FAR && fabs(now_y[i]) < FAR))
                return (step - 1.0) * interval;
            low[0] = LEAST(now_x[i], low[0]), high[0] = MOST(now_x[i], high[0]);
            low[1] = LEAST(now_y[i], low[1]), high[1] = MOST(now_y[i], high[1]);
        }
        if (step == 0.0)
            continue;
        const int64_t top = (int64_t)floor(high[1] + MARGIN), right = (int64_t)floor(high[0] + MARGIN);
        for (int64_t row = (int64_t)floor(low[1] - MARGIN); row <= top; row++)
            for (int64_t column = (int64_t)floor(low[0] - MARGIN); column <= right; column++) {
                const int is_inside = 0 <= row && row < c->rows && 0 <= column && column < c->columns;
                const double u = (double)column, v = (double)row;
                if ((is_inside && c->costs[row * c->columns + column] != LETHAL)
                    || !meets_cell(now_x, now_y, c->corners, u, v, MARGIN, 1))
                    continue;
                /* Near at the start already: then it may come nearer, but not touch it, unless it did. */
                if (!meets_cell(start_x, start_y, c->corners, u, v, MARGIN, 1)
                    || (meets_cell(now_x, now_y, c->corners, u, v, 0.0, 1)
                        && !meets_cell(start_x, start_y, c->corners, u, v, 0.0, 1)))
                    return (step - 1.0) * interval;
            }
    }
    return INFINITY;
}

int64_t find_place(const double *path, const double *along, int64_t count, int64_t at, double ahead, double x, double y)
{
    const double last = along[at] + ahead;
    double least = INFINITY;
    for (int64_t i = at; i < count; i++) {
        const double dx = path[3 * i] - x, dy = path[3 * i + 1] - y, square = dx * dx + dy * dy;
        if (square < least)
            least = square, at = i;
        if (along[i] >= last)
            break;
    }
    return at;
}

int64_t leave_circle(const double *path, int64_t count, int64_t at, double reach, double x, double y)
{
    for (int64_t i = at; i < count; i++) {
        const double dx = path[3 * i] - x, dy = path[3 * i + 1] - y;
        if (sqrt(dx * dx + dy * dy) >= reach)
            return i;
    }
    return -1;
}
