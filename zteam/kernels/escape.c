/* A way out of a narrow place: turns on the spot and straight drives over a grid of places and headings, the cheapest
   first. Points are metres in the frame of the base. A state is heading * size * size + row * size + column. */
#include <stdlib.h>
#include "kernels.h"
#include "outlines.h"
#include "sines.h"

/* Metres that are free around the base. */
#define MARGIN 0.03
/* Metres that a way leads nearer to the place, if there is such a one, and that it does at least. */
#define NEARER 0.5
#define LEAST_NEARER 0.15
/* Metres beside the way within which a place is on it; what a metre beside it counts in metres along it elsewhere, and
   what it counts at all to be off it. */
#define ON_WAY 0.15
#define OFF_COST 3.0
#define OFF_WAY 100.0
enum {
    /* Steps that have to be free for one: the safety layer stops a robot so far ahead of a wall, and of a teammate. */
    WALL_STEPS = 3,
    MATE_STEPS = 5,
    BORDER = 2 * MATE_STEPS, /* cells at the edge from which no drive begins: steps are up to two cells */
    MOST_COST = 200,         /* of all moves */
    /* Cells around the place of a move that did not work, and headings, for which none like it is tried. */
    FAILED_NEAR = 3,
    FAILED_HEADINGS = 3,
    KINDS = 4,
    FRONTS = 4, /* more than a step costs */
};
/* Forward, to the left, to the right, back; and what a step costs: where it drives back no laser looks. */
static const int64_t KIND[KINDS] = {1, 2, -2, -1};
static const int PRICE[KINDS] = {1, 1, 1, 3};
/* Marks of a state: the base cannot be there for a wall, or a teammate; no move of this kind begins there. */
#define WALL 1
#define MATE 2
#define CLOSED(k) (4 << (k))

/* What is left from a place to the end of the way, over the best of its points. Without a way: less the further away it
   is, and nothing is won near the base and near places that are shunned. */
static double left_from(const surroundings *s, int64_t place)
{
    const double x = s->cell * (double)(place % s->size - s->size / 2);
    const double y = s->cell * (double)(place / s->size - s->size / 2);
    if (s->points == 0) {
        int is_near = s->away[place] < s->least;
        for (const double *at = s->shunned; at < s->shunned + 2 * s->shunned_count; at += 2)
            is_near |= sqrt((x - at[0]) * (x - at[0]) + (y - at[1]) * (y - at[1])) < s->beside;
        return is_near ? 0.0 : -NEARER / s->leaves * s->away[place];
    }
    double least = INFINITY;
    for (const double *at = s->way; at < s->way + 3 * s->points; at += 3) {
        const double off = sqrt((x - at[0]) * (x - at[0]) + (y - at[1]) * (y - at[1]));
        const double left = at[2] + (off < ON_WAY ? 0.0 : OFF_WAY + OFF_COST * off);
        least = left < least ? left : least;
    }
    return least;
}

/* Mark the cells with points in a grid whose middle is the base. */
static void mark_points(
    const surroundings *s, const double *points, int64_t count, uint8_t mark, uint8_t *grid, int64_t width)
{
    const double most = (double)(width / 2);
    for (const double *at = points; at < points + 2 * count; at += 2) {
        const double column = rint(at[0] / s->cell), row = rint(at[1] / s->cell);
        /* What is nearer than the margin now, by the cells, does not keep the base from moving away. */
        if (fabs(column) <= most && fabs(row) <= most && depth_of(at[0], at[1], s->planes, s->sides) > MARGIN + s->cell)
            grid[(width / 2 + (int64_t)row) * width + width / 2 + (int64_t)column] |= mark;
    }
}

/* Mark the states of a heading at which the base covers a marked cell, with its margin. */
static void mark_places(
    const surroundings *s, const double *heading, const uint8_t *grid, int64_t width, uint8_t *restrict marks)
{
    const int64_t size = s->size, far = (width - size) / 2;
    for (int64_t row = -far; row <= far; row++)
        for (int64_t column = -far; column <= far; column++) {
            const double x = s->cell * (double)column, y = s->cell * (double)row, c = heading[2], d = heading[3];
            if (!(depth_of(c * x + d * y, c * y - d * x, s->planes, s->sides) <= MARGIN))
                continue;
            for (int64_t i = 0; i < size; i++) {
                const uint8_t *covered = grid + (i + row + far) * width + column + far;
                for (int64_t j = 0; j < size; j++)
                    marks[i * size + j] |= covered[j];
            }
        }
}

/* Close what is like a move that did not work: near its place, at the headings that are the most like its own. */
static void close_failed(const surroundings *s, const double *failed, uint8_t *marks)
{
    const int64_t size = s->size, count = s->heading_count;
    const double x = rint(failed[1] / s->cell) + (double)(size / 2), y = rint(failed[2] / s->cell) + (double)(size / 2);
    double cosine, sine;
    cosine_sine(failed[3], &cosine, &sine);
    for (int64_t h = 0; h < count; h++) {
        const double *own = s->headings + 4 * h, like = own[2] * cosine + own[3] * sine;
        int64_t better = 0;
        for (const double *other = s->headings; other < s->headings + 4 * count; other += 4)
            better += other[2] * cosine + other[3] * sine > like;
        for (int64_t place = 0; better < FAILED_HEADINGS && place < size * size; place++)
            for (int k = 0; k < KINDS; k++)
                if ((double)KIND[k] == failed[0] && fabs((double)(place % size) - x) <= FAILED_NEAR
                    && fabs((double)(place / size) - y) <= FAILED_NEAR)
                    marks[h * size * size + place] |= CLOSED(k);
    }
}

/* By how much a state changes with a step of a kind. */
static int64_t step_of(const surroundings *s, int64_t heading, int64_t kind)
{
    const double *ahead = s->headings + 4 * heading;
    if (kind == 1 || kind == -1)
        return kind * (s->size * (int64_t)ahead[1] + (int64_t)ahead[0]);
    return s->size * s->size * ((heading + kind / 2 + s->heading_count) % s->heading_count - heading);
}

/* Whether a step of a kind can be taken. */
static int is_free(const uint8_t *marks, int64_t state, int k, int64_t step)
{
    if (marks[state] & CLOSED(k))
        return 0;
    if (KIND[k] == 2 || KIND[k] == -2)
        return !(marks[state + step] & WALL);
    for (int ahead = 1; ahead < MATE_STEPS; ahead++)
        if (marks[state + ahead * step] & (ahead < WALL_STEPS ? WALL : MATE))
            return 0;
    return 1;
}

int64_t find_moves(const surroundings *s, int64_t *moves)
{
    const int64_t size = s->size, places = size * size, states = places * s->heading_count, middle = size / 2;
    const int64_t reach = middle - BORDER, width = size + 2 * (int64_t)ceil((s->radius + MARGIN) / s->cell);
    const int64_t start = middle * size + middle;
    uint8_t *grid = calloc((size_t)(width * width), 1), *marks = calloc((size_t)states, 3);
    uint8_t *costs = marks + states, *kinds = costs + states;
    int32_t *fronts = malloc((size_t)(FRONTS * states) * sizeof *fronts);
    double *left = malloc((size_t)places * sizeof *left);
    int64_t counts[FRONTS] = {1}, best = start, found = -1;
    if (!grid || !marks || !fronts || !left)
        goto end;
    mark_points(s, s->hits, s->hit_count, WALL, grid, width);
    mark_points(s, s->mates, s->mate_count, WALL | MATE, grid, width);
    for (int64_t h = 0; h < s->heading_count; h++)
        mark_places(s, s->headings + 4 * h, grid, width, marks + h * places);
    for (const double *failed = s->failed; failed < s->failed + 4 * s->failed_count; failed += 4)
        close_failed(s, failed, marks);
    for (int64_t state = 0; state < states; state++) {
        const int64_t y = state % places / size - middle, x = state % size - middle;
        if (x * x + y * y > reach * reach)
            marks[state] |= CLOSED(0) | CLOSED(3);
        costs[state] = MOST_COST;
    }
    for (int64_t place = 0; place < places; place++)
        left[place] = left_from(s, place);
    const double near_enough = left[start] - NEARER < OFF_WAY ? left[start] - NEARER : OFF_WAY;
    double nearest = left[start] - LEAST_NEARER;
    costs[start] = 0;
    fronts[0] = (int32_t)start;
    for (int cost = 0; cost < MOST_COST && nearest > near_enough; cost++) {
        /* All that costs so much, without what was reached cheaper since. Of the same use, the first state counts. */
        int32_t *front = fronts + cost % FRONTS * states;
        int64_t count = 0, first = -1;
        for (int64_t i = 0; i < counts[cost % FRONTS]; i++) {
            const int64_t state = front[i];
            if (costs[state] != cost)
                continue;
            front[count++] = (int32_t)state;
            const double own = left[state % places], least = first < 0 ? INFINITY : left[first % places];
            if (own < least || (own == least && state < first))
                first = state;
        }
        counts[cost % FRONTS] = 0;
        if (first >= 0 && left[first % places] < nearest)
            best = first, nearest = left[first % places];
        for (int k = 0; k < KINDS && nearest > near_enough; k++)
            for (int64_t i = 0; i < count; i++) {
                const int64_t step = step_of(s, front[i] / places, KIND[k]), end = front[i] + step;
                const int total = cost + PRICE[k], slot = total % FRONTS;
                /* The cheaper test first. */
                if (costs[end] <= total || !is_free(marks, front[i], k, step))
                    continue;
                costs[end] = (uint8_t)total, kinds[end] = (uint8_t)k;
                fronts[slot * states + counts[slot]++] = (int32_t)end;
            }
    }
    found = 0;
    for (int64_t kind = 0; best != start;) {
        const int64_t heading = best / places, count = s->heading_count;
        if (KIND[kinds[best]] != kind) {
            kind = KIND[kinds[best]];
            int64_t *move = moves + 4 * found++;
            move[0] = kind, move[1] = best % size - middle, move[2] = best % places / size - middle, move[3] = heading;
        }
        const int is_turn = kind == 2 || kind == -2;
        best -= step_of(s, is_turn ? (heading - kind / 2 + count) % count : heading, kind);
    }
end:
    free(grid);
    free(marks);
    free(fronts);
    free(left);
    return found;
}
