/* Ways over grids of weights: A*, and straight lines. Weights are 0 where no way leads, as on the grid's border.
   Costs are whole numbers, so they do not depend on the order in which cells are visited. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "kernels.h"
#include "sines.h"

#define LEAST(a, b) ((a) < (b) ? (a) : (b))
#define MOST(a, b) ((a) > (b) ? (a) : (b))
enum {
    BUCKETS = 1024,
    SHIFT = 8,    /* of a cost to its bucket; no step adds 2^18 to cost and heuristic together */
    ROOM = 16384, /* entries of the queue that fit at first */
};
#define NONE UINT32_MAX /* no entry; as a cost, of a cell that the search has not met */

typedef struct {
    uint32_t cell, cost, next; /* in the list of one bucket */
} entry;

/* Write a costmap's cells as weights to the inner part of `out`: neutral + cost * factor / 256, 0 from `barred` on. */
void weigh_cells(const uint8_t *costs, int64_t rows, int64_t columns, int64_t neutral, int64_t factor, int64_t barred,
                 int64_t unknown, uint8_t *restrict out)
{
    const uint16_t base = (uint16_t)neutral, slope = (uint16_t)factor, first = (uint16_t)barred;
    for (int64_t y = 0; y < rows; y++) {
        const uint8_t *given = costs + y * columns;
        uint8_t *restrict made = out + (y + 1) * (columns + 2) + 1;
        for (int64_t x = 0; x < columns; x++) {
            const uint16_t cost = given[x], weight = (uint16_t)(base + ((uint16_t)(cost * slope) >> 8));
            made[x] = (uint8_t)(cost == 255 ? unknown : cost < first ? weight : 0);
        }
    }
}

/* Find the cheapest way between two cells and write its costs; 1 if there is one, 0 if all that can be reached has been,
   -1 without memory. The heuristic is the octile distance, at the least weight. Cells whose cost plus heuristic have the
   same digits above SHIFT are visited in no order. */
int search(const uint8_t *restrict weights, int64_t columns, int64_t start, int64_t goal, const int64_t *steps,
           uint32_t *restrict costs, int64_t *restrict box)
{
    const int64_t straight = steps[0], diagonal = steps[1], longer = steps[2] * straight;
    const int64_t shorter = steps[2] * (diagonal - straight), goal_x = goal % columns, goal_y = goal / columns;
    const int move_x[8] = {1, -1, 0, 0, 1, -1, 1, -1}, move_y[8] = {0, 0, 1, -1, 1, 1, -1, -1};
    int64_t bottom = start / columns, top = bottom, left = start % columns, right = left;
    const int64_t first_x = MOST(left - goal_x, goal_x - left), first_y = MOST(top - goal_y, goal_y - top);
    int64_t bucket = (longer * MOST(first_x, first_y) + shorter * LEAST(first_x, first_y)) >> SHIFT;
    uint32_t heads[BUCKETS], used = 1, room = ROOM, spare = NONE;
    entry *queue = malloc(ROOM * sizeof *queue);
    if (!queue)
        return -1;
    for (int i = 0; i < BUCKETS; i++)
        heads[i] = NONE;
    costs[start] = 0;
    queue[0] = (entry){(uint32_t)start, 0, NONE};
    heads[bucket & (BUCKETS - 1)] = 0;
    for (int64_t waiting = 1; waiting > 0;) {
        uint32_t found = heads[bucket & (BUCKETS - 1)];
        if (found == NONE) {
            if (costs[goal] != NONE && costs[goal] >> SHIFT <= bucket)
                break;
            bucket++;
            continue;
        }
        const uint32_t cell = queue[found].cell, cost = queue[found].cost;
        heads[bucket & (BUCKETS - 1)] = queue[found].next;
        queue[found].next = spare;
        spare = found;
        waiting--;
        /* It may have been met on a cheaper way since. */
        if (cost != costs[cell])
            continue;
        const int64_t y = cell / (uint32_t)columns, x = cell - y * columns;
        bottom = LEAST(y, bottom), top = MOST(y, top), left = LEAST(x, left), right = MOST(x, right);
        const uint8_t *here = weights + cell;
        const int open[4] = {here[1] > 0, here[-1] > 0, here[columns] > 0, here[-columns] > 0};
#pragma GCC unroll 8
        for (int k = 0; k < 8; k++) {
            const int64_t to = cell + move_y[k] * columns + move_x[k], weight = weights[to];
            const int64_t new = cost + (k < 4 ? straight : diagonal) * weight;
            /* Most cells that can be entered have been, for less. */
            if (new >= costs[to] || weight == 0 || (k >= 4 && !(open[k & 1] && open[2 + (k - 4) / 2])))
                continue;
            costs[to] = (uint32_t)new;
            int64_t dx = x + move_x[k] - goal_x, dy = y + move_y[k] - goal_y;
            dx = MOST(dx, -dx), dy = MOST(dy, -dy);
            const int64_t total = new + longer * MOST(dx, dy) + shorter * LEAST(dx, dy);
            const int64_t place = (total >> SHIFT) & (BUCKETS - 1);
            if (spare == NONE && used == room) {
                entry *larger = room < NONE / 2 ? realloc(queue, 2 * (size_t)room * sizeof *queue) : NULL;
                if (!larger) {
                    free(queue);
                    return -1;
                }
                queue = larger;
                room *= 2;
            }
            const uint32_t at = spare == NONE ? used++ : spare;
            spare = spare == NONE ? NONE : queue[at].next;
            queue[at] = (entry){(uint32_t)to, (uint32_t)new, heads[place]};
            heads[place] = at;
            waiting++;
        }
    }
    free(queue);
    /* The neighbours of what was visited have costs too. */
    box[0] = bottom - 1, box[1] = top + 1, box[2] = left - 1, box[3] = right + 1;
    return costs[goal] != NONE;
}

/* Write the cells of the way that `search` has found, from the goal back to the start; return how many they are, 0 if
   the costs lead to no start, or to more cells than `out` has room for. */
int64_t trace(const uint8_t *weights, int64_t columns, int64_t start, int64_t goal, const int64_t *steps,
              const uint32_t *costs, int64_t *out, int64_t room)
{
    int64_t cell = goal, count = 0;
    while (cell >= 0 && count < room) {
        out[count++] = cell;
        if (cell == start)
            return count;
        const int64_t weight = weights[cell], cost = costs[cell];
        int64_t before = -1;
        /* Always the same one of several ways that cost the same. */
        for (int64_t dy = -1; dy <= 1; dy++)
            for (int64_t dx = -1; dx <= 1; dx++) {
                const int64_t other = cell + dy * columns + dx, step = dx != 0 && dy != 0 ? steps[1] : steps[0];
                if ((dx == 0 && dy == 0) || costs[other] + step * weight != cost || weights[other] == 0)
                    continue;
                if (dx == 0 || dy == 0 || (weights[cell + dx] != 0 && weights[cell + dy * columns] != 0))
                    before = other;
            }
        cell = before;
    }
    return 0;
}

/* Cost of the line between the middles of two cells (column, row): the integral of the weights along it. INFINITY if
   it is blocked, or certainly costs more than `most`. It is followed through every cell that it touches. */
static double measure_line(const uint8_t *weights, int64_t columns, const int64_t *from, const int64_t *to, double most)
{
    const int64_t dx = MOST(to[0] - from[0], from[0] - to[0]), dy = MOST(to[1] - from[1], from[1] - to[1]);
    const int64_t step_x = to[0] > from[0] ? 1 : -1, step_y = to[1] > from[1] ? columns : -columns;
    const int64_t step = dx > dy ? step_x : step_y, aside = dx > dy ? step_y : step_x;
    /* Along the line time runs in whole ticks: it crosses sides of cells every `every` of them, and sides that are along
       it, at most one between two others, every 2 * `steps`. */
    const int64_t steps = MOST(dx, dy), every = 2 * MOST(LEAST(dx, dy), 1), total = every * steps;
    if (total == 0)
        return 0.0;
    const double length = sqrt((double)(dx * dx + dy * dy));
    const double bound = most / length * (double)total * (1.0 + 1e-9) + 1.0;
    const int64_t limit = (int64_t)MOST(LEAST(bound, 9e18), -1.0);
    int64_t next = every / 2, next_aside = LEAST(dx, dy) > 0 ? steps : INT64_MAX, now = 0, ticks = 0;
    const uint8_t *cell = weights + from[1] * columns + from[0];
    for (int64_t k = 0; k < steps; k++, cell += step, next += every) {
        if (*cell == 0 || ticks > limit)
            return INFINITY;
        if (next_aside < next) {
            ticks += *cell * (next_aside - now);
            now = next_aside;
            next_aside += 2 * steps;
            cell += aside;
            if (*cell == 0)
                return INFINITY;
        }
        ticks += *cell * (next - now);
        now = next;
        if (next_aside == next) {
            /* Through a corner: as with steps, both cells beside it must be free. */
            if (cell[step] == 0 || cell[aside] == 0)
                return INFINITY;
            next_aside += 2 * steps;
            cell += aside;
        }
    }
    if (*cell == 0)
        return INFINITY;
    ticks += *cell * (total - now);
    return length * ((double)ticks / (double)total);
}

/* Write the cost of each line between two cells; INFINITY where it is blocked. */
void measure_lines(const uint8_t *weights, int64_t columns, const int64_t *begins, const int64_t *ends, int64_t count,
                   double *out)
{
    for (int64_t i = 0; i < count; i++)
        out[i] = measure_line(weights, columns, begins + 2 * i, ends + 2 * i, INFINITY);
}

enum { SIDES = 7 };

/* The place so many cells to the left of point i of a way, in the grid; the first and the last one stay. */
static void place_beside(const int64_t *points, int64_t count, int64_t i, double shift, int64_t rows, int64_t columns,
                         int64_t *at)
{
    double dx = 0.0, dy = 0.0, along = 1.0;
    if (0 < i && i < count - 1) {
        dx = (double)(points[2 * i + 2] - points[2 * i - 2]), dy = (double)(points[2 * i + 3] - points[2 * i - 1]);
        along = MOST(sqrt(dx * dx + dy * dy), 1e-9);
    }
    at[0] = LEAST(MOST(points[2 * i] + (int64_t)rint(-dy / along * shift), 0), columns - 1);
    at[1] = LEAST(MOST(points[2 * i + 1] + (int64_t)rint(dx / along * shift), 0), rows - 1);
}

/* Write the cheapest way through one place beside each point of a way (count, 2: column, row): itself, or up to 3 widths
   to a side. Dynamic programming; `best` and `before` have room for SIDES a point. */
static void shift_points(const uint8_t *weights, int64_t rows, int64_t columns, const int64_t *points, int64_t count,
                         double width, double *best, int64_t *before, int64_t *moved)
{
    int64_t side = 0, places[2][SIDES][2];
    for (int64_t i = 0; i < count; i++)
        for (int64_t k = 0; k < SIDES; k++) {
            int64_t(*from)[2] = places[(i + 1) % 2], *to = places[i % 2][k], *come = before + SIDES * i + k;
            double *least = best + SIDES * i + k;
            *least = i == 0 ? 0.0 : INFINITY;
            *come = 0;
            place_beside(points, count, i, (double)(k - SIDES / 2) * width, rows, columns, to);
            for (int64_t j = 0; i > 0 && j < SIDES; j++) {
                const double so_far = best[SIDES * (i - 1) + j];
                const double cost = so_far + measure_line(weights, columns, from[j], to, *least - so_far);
                if (cost < *least)
                    *least = cost, *come = j;
            }
        }
    /* All places of the last point are the same. */
    for (int64_t i = count - 1; i >= 0; i--) {
        place_beside(points, count, i, (double)(side - SIDES / 2) * width, rows, columns, moved + 2 * i);
        side = before[SIDES * i + side];
    }
}

/* Find the cheapest way along lines that join every `stride`th cell of a way, and the last, to such cells up to `reach`
   cells before: dynamic programming. `best` becomes what the way to each cell costs, `before` where its line begins. */
static void shorten(const uint8_t *weights, int64_t columns, const int64_t *way, int64_t count, int64_t stride,
                    int64_t reach, double least, double *best, int64_t *before)
{
    best[0] = 0.0, before[0] = -1;
    for (int64_t i = 1; i < count; i++) {
        const int64_t *to = way + 2 * i;
        best[i] = best[i - 1] + measure_line(weights, columns, to - 2, to, INFINITY);
        before[i] = i - 1;
        if (i % stride != 0 && i != count - 1)
            continue;
        for (int64_t j = MOST(i - reach, 0) / stride * stride; j < i - 1; j += stride) {
            const double most = best[i] - best[j];
            const double dx = (double)(way[2 * j] - to[0]), dy = (double)(way[2 * j + 1] - to[1]);
            if (least * sqrt(dx * dx + dy * dy) >= most)
                continue;
            const double cost = best[j] + measure_line(weights, columns, way + 2 * j, to, most);
            if (cost < best[i])
                best[i] = cost, before[i] = j;
        }
    }
}

/* Write the corners of the way that `shorten` finds; return how many they are. */
static int64_t join(const uint8_t *weights, int64_t columns, const int64_t *way, int64_t count, int64_t stride,
                    int64_t reach, double least, double *best, int64_t *before, int64_t *out)
{
    int64_t corners = 0, different = 1, made = 1;
    shorten(weights, columns, way, count, stride, reach, least, best, before);
    for (int64_t i = count - 1; i >= 0; i = before[i])
        corners++;
    for (int64_t i = count - 1, k = corners; i >= 0; i = before[i])
        k--, out[2 * k] = way[2 * i], out[2 * k + 1] = way[2 * i + 1];
    for (int64_t i = 1; i < corners; i++)
        if (out[2 * i] != out[2 * i - 2] || out[2 * i + 1] != out[2 * i - 1])
            out[2 * different] = out[2 * i], out[2 * different + 1] = out[2 * i + 1], different++;
    /* Without the points at which it does not turn. */
    int64_t x = out[0], y = out[1];
    for (int64_t i = 1; i < different; i++) {
        const int64_t to_x = out[2 * i] - x, to_y = out[2 * i + 1] - y;
        x += to_x, y += to_y;
        const int64_t on_x = i < different - 1 ? out[2 * i + 2] - x : -to_x;
        const int64_t on_y = i < different - 1 ? out[2 * i + 3] - y : -to_y;
        if (to_x * on_y != to_y * on_x || to_x * on_x + to_y * on_y < 0)
            out[2 * made] = x, out[2 * made + 1] = y, made++;
    }
    return made;
}

/* Write corners, and points on the lines between them, at most `spacing` cells apart; return how many there are. */
static int64_t space_out(const int64_t *corners, int64_t count, double spacing, int64_t *out)
{
    int64_t made = 0;
    for (int64_t i = 0; i < count; i++) {
        const int64_t *from = corners + 2 * i, *to = i < count - 1 ? from + 2 : from;
        const double dx = (double)(to[0] - from[0]), dy = (double)(to[1] - from[1]);
        const int64_t parts = MOST(-(int64_t)floor(-sqrt(dx * dx + dy * dy) / spacing), 1);
        for (int64_t k = 0; k < parts; k++, made++)
            out[2 * made] = (int64_t)rint((double)from[0] + dx * ((double)k / (double)parts)),
            out[2 * made + 1] = (int64_t)rint((double)from[1] + dy * ((double)k / (double)parts));
    }
    return made;
}

/* Write the corners of straight lines that cost no more than a way from cell to cell (count, 2: column, row); return how
   many they are. First the cheapest way along lines between every `stride`th of its cells; then points on it, `spacing`
   cells apart, move to the side where that is cheaper, less far each time. All other arrays have `room`. */
int64_t straighten(const uint8_t *weights, int64_t rows, int64_t columns, const int64_t *way, int64_t count,
                   int64_t stride, int64_t reach, int64_t spacing, double least, double *best, int64_t *before,
                   int64_t *spaced, int64_t *moved, int64_t *out)
{
    const double widths[] = {4.0, 2.0, 1.0};
    const int64_t corners = join(weights, columns, way, count, stride, reach, least, best, before, out);
    const double cost = best[count - 1];
    int64_t points = corners;
    memcpy(moved, out, (size_t)(2 * corners) * sizeof *out);
    for (int i = 0; i < 3; i++) {
        points = space_out(moved, points, (double)spacing, spaced);
        shift_points(weights, rows, columns, spaced, points, widths[i], best, before, moved);
    }
    const int64_t fewer = join(weights, columns, moved, points, 1, reach / spacing, least, best, before, spaced);
    if (!(best[points - 1] < cost))
        return corners;
    memcpy(out, spaced, (size_t)(2 * fewer) * sizeof *out);
    return fewer;
}

/* Write poses (x, y, yaw) along lines between points (count, 2), up to `spacing` apart, that face the next one; the last
   has `yaw`. Return how many there are; without `out`, only that. */
int64_t lay_path(const double *points, int64_t count, double yaw, double spacing, double *out)
{
    int64_t made = 0;
    for (int64_t i = 0; i < count; i++) {
        const double *from = points + 2 * i, dx = i < count - 1 ? from[2] - from[0] : 0.0;
        const double dy = i < count - 1 ? from[3] - from[1] : 0.0;
        /* Points in the same place are one. */
        if (i < count - 1 && !(fabs(dx) > 1e-9 || fabs(dy) > 1e-9))
            continue;
        const int64_t parts = MOST(-(int64_t)floor(-sqrt(dx * dx + dy * dy) / spacing), 1);
        for (int64_t k = 0; k < parts; k++, made++)
            if (out) {
                const double share = (double)k / (double)parts;
                out[3 * made] = from[0] + share * dx, out[3 * made + 1] = from[1] + share * dy;
                out[3 * made + 2] = i < count - 1 ? angle_of(dx, dy) : yaw;
            }
    }
    return made;
}
