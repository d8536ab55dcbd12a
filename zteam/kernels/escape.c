/* A way out of a narrow place: turns on the spot and straight drives over a grid of places and headings, the cheapest
   first. Points are metres in the frame of the base. A state is heading * PLACES + row * SIZE + column. */
#include <stdlib.h>
#include <string.h>
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
    /* Cells from the middle: where drives may begin, and the edge, beyond all that they look at (two cells a step). */
    REACH = 32,
    MIDDLE = REACH + 2 * MATE_STEPS,
    SIZE = 2 * MIDDLE + 1,
    PLACES = SIZE * SIZE,
    START = MIDDLE * SIZE + MIDDLE,
    HEADINGS = 16,
    STATES = HEADINGS * PLACES,
    MOST_COST = 200,  /* of all moves */
    FARTHEST = 10000, /* cells from a base to its corners */
    /* Cells around the place of a move that did not work, and headings, for which none like it is tried. */
    FAILED_NEAR = 3,
    FAILED_HEADINGS = 3,
    KINDS = 4,
    FRONTS = 4, /* more than a step costs */
};
/* Forward, to the left, to the right, back; and what a step costs: where it drives back no laser looks. */
static const int KIND[KINDS] = {1, 2, -2, -1};
static const int PRICE[KINDS] = {1, 1, 1, 3};
/* Marks of a state: the base cannot be there for a wall, or a teammate; no move of this kind begins there. */
#define WALL 1
#define MATE 2
#define CLOSED(k) (4 << (k))

typedef struct {
    double left[PLACES];
    int32_t fronts[FRONTS][STATES];
    uint8_t marks[STATES], costs[STATES], kinds[STATES]; /* kinds: by which one it was reached */
} memory;

static double distance(const double *at, double x, double y)
{
    return sqrt((x - at[0]) * (x - at[0]) + (y - at[1]) * (y - at[1]));
}

/* What is left from a place to the end of the way, over the best of its points. Without a way: less the further away it
   is, and nothing is won near the base and near places that are shunned. */
static double left_from(const surroundings *s, int place)
{
    const double x = s->cell * (place % SIZE - MIDDLE), y = s->cell * (place / SIZE - MIDDLE);
    double least = INFINITY, after = 0.0;
    if (s->stops == 0) {
        int is_near = s->away[place] < s->least;
        for (const double *at = s->shunned; at < s->shunned + 2 * s->shunned_count; at += 2)
            is_near |= distance(at, x, y) < s->beside;
        return is_near ? 0.0 : -NEARER / s->leaves * s->away[place];
    }
    for (int64_t i = s->stops - 1; i >= 0; i--) {
        const double *at = s->way + 2 * i, off = distance(at, x, y);
        const double left = after + (off < ON_WAY ? 0.0 : OFF_WAY + OFF_COST * off);
        least = left < least ? left : least;
        after += i > 0 ? distance(at - 2, at[0], at[1]) : 0.0;
    }
    return least;
}

/* Mark the cells with points in a grid whose middle is the base. */
static void mark_points(const surroundings *s, int64_t half, uint8_t *grid)
{
    for (int64_t i = 0; i < s->count; i++) {
        const double *at = s->points + 2 * i, column = rint(at[0] / s->cell), row = rint(at[1] / s->cell);
        if (!(fabs(column) <= (double)half && fabs(row) <= (double)half))
            continue;
        /* What is nearer than the margin now, by the cells, does not keep the base from moving away. */
        if (depth_of(at[0], at[1], s->planes, s->sides) > MARGIN + s->cell)
            grid[(half + (int64_t)row) * (2 * half + 1) + half + (int64_t)column] |= i < s->hits ? WALL : WALL | MATE;
    }
}

/* Mark the states of a heading at which the base covers a marked cell, with its margin. */
static void mark_places(
    const surroundings *s, const double *heading, int64_t half, const uint8_t *grid, uint8_t *restrict marks)
{
    const int64_t width = 2 * half + 1, far = half - MIDDLE;
    const double cosine = heading[3], sine = heading[4];
    for (int64_t row = -far; row <= far; row++)
        for (int64_t column = -far; column <= far; column++) {
            const double x = s->cell * (double)column, y = s->cell * (double)row;
            if (!(depth_of(cosine * x + sine * y, cosine * y - sine * x, s->planes, s->sides) <= MARGIN))
                continue;
            for (int64_t i = 0; i < SIZE; i++) {
                const uint8_t *covered = grid + (far + row + i) * width + far + column;
                for (int64_t j = 0; j < SIZE; j++)
                    marks[i * SIZE + j] |= covered[j];
            }
        }
}

/* Close what is like a move that did not work: near its place, at the headings that are the most like its own. */
static void close_failed(const surroundings *s, const double *failed, uint8_t *marks)
{
    const double x = rint(failed[1] / s->cell) + MIDDLE, y = rint(failed[2] / s->cell) + MIDDLE;
    double cosine, sine, like[HEADINGS];
    cosine_sine(failed[3], &cosine, &sine);
    for (int h = 0; h < HEADINGS; h++)
        like[h] = s->headings[5 * h + 3] * cosine + s->headings[5 * h + 4] * sine;
    for (int h = 0; h < HEADINGS; h++) {
        int better = 0;
        for (int other = 0; other < HEADINGS; other++)
            better += like[other] > like[h];
        for (int place = 0; place < PLACES && better < FAILED_HEADINGS; place++)
            if (fabs(place % SIZE - x) <= FAILED_NEAR && fabs(place / SIZE - y) <= FAILED_NEAR)
                for (int k = 0; k < KINDS; k++)
                    marks[h * PLACES + place] |= KIND[k] == failed[0] ? CLOSED(k) : 0;
    }
}

/* By how much a state changes with a step of a kind. */
static int step_of(const surroundings *s, int heading, int kind)
{
    const double *ahead = s->headings + 5 * heading;
    if (kind == 1 || kind == -1)
        return kind * (SIZE * (int)ahead[1] + (int)ahead[0]);
    return PLACES * ((heading + kind / 2 + HEADINGS) % HEADINGS - heading);
}

/* Whether a step of a kind can be taken. */
static int is_free(const uint8_t *marks, int state, int k, int step)
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

/* Find the state to go to, and the kind of move by which each state is reached at the least cost. All that can be
   reached is visited in the order of costs (Dijkstra 1959) until a place is near enough. */
static int look_for(const surroundings *s, memory *m)
{
    const double *left = m->left;
    const double near_enough = left[START] - NEARER < OFF_WAY ? left[START] - NEARER : OFF_WAY;
    double nearest = left[START] - LEAST_NEARER;
    int best = START, counts[FRONTS] = {1};
    memset(m->costs, MOST_COST, sizeof m->costs);
    m->costs[START] = 0;
    m->fronts[0][0] = START;
    for (int cost = 0; cost < MOST_COST && nearest > near_enough; cost++) {
        /* Keep what was not reached cheaper since. Of places that are as good, the first state counts. */
        int32_t *front = m->fronts[cost % FRONTS];
        int count = 0, first = START;
        for (int i = 0; i < counts[cost % FRONTS]; i++) {
            const int state = front[i];
            if (m->costs[state] != cost)
                continue;
            const double own = left[state % PLACES], least = left[first % PLACES];
            first = count == 0 || own < least || (own == least && state < first) ? state : first;
            front[count++] = state;
        }
        counts[cost % FRONTS] = 0;
        if (left[first % PLACES] < nearest)
            best = first, nearest = left[first % PLACES];
        for (int k = 0; k < KINDS && nearest > near_enough; k++)
            for (int i = 0; i < count; i++) {
                const int step = step_of(s, front[i] / PLACES, KIND[k]), end = front[i] + step;
                const int total = cost + PRICE[k], slot = total % FRONTS;
                if (m->costs[end] <= total || !is_free(m->marks, front[i], k, step))
                    continue;
                m->costs[end] = (uint8_t)total, m->kinds[end] = (uint8_t)k;
                m->fronts[slot][counts[slot]++] = end;
            }
    }
    return best;
}

int64_t find_moves(const surroundings *s, double *moves)
{
    const double far = ceil((s->radius + MARGIN) / s->cell);
    const int64_t half = far >= 0.0 && far <= FARTHEST ? MIDDLE + (int64_t)far : 0;
    uint8_t *grid = half ? calloc((size_t)(2 * half + 1), (size_t)(2 * half + 1)) : NULL;
    memory *m = calloc(1, sizeof *m);
    int64_t count = m && grid ? 0 : -1;
    if (count == 0) {
        mark_points(s, half, grid);
        for (int h = 0; h < HEADINGS; h++)
            mark_places(s, s->headings + 5 * h, half, grid, m->marks + h * PLACES);
        for (int64_t i = 0; i < s->failed_count; i++)
            close_failed(s, s->failed + 4 * i, m->marks);
        for (int state = 0; state < STATES; state++) {
            const int x = state % SIZE - MIDDLE, y = state % PLACES / SIZE - MIDDLE;
            m->marks[state] |= x * x + y * y > REACH * REACH ? CLOSED(0) | CLOSED(3) : 0;
        }
        for (int place = 0; place < PLACES; place++)
            m->left[place] = left_from(s, place);
        /* From the end of the last move: one goes on where the step before is of the same kind. */
        double *move = moves + 4 * MOST_COST;
        for (int at = look_for(s, m), last = 0; at != START;) {
            const int heading = at / PLACES, kind = KIND[m->kinds[at]];
            if (kind != last) {
                move -= 4, count++;
                move[0] = kind, move[3] = s->headings[5 * heading + 2];
                move[1] = s->cell * (at % SIZE - MIDDLE), move[2] = s->cell * (at % PLACES / SIZE - MIDDLE);
            }
            last = kind;
            at -= step_of(s, kind == 1 || kind == -1 ? heading : (heading - kind / 2 + HEADINGS) % HEADINGS, kind);
        }
    }
    free(grid);
    free(m);
    return count;
}
