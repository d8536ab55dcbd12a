/* Which robot of a formation takes which slot, and how much room walls leave it. Metres and radians. */
#include <string.h>
#include "kernels.h"
#include "sines.h"

/* What costs more, or is no number, costs this. */
#define MOST 1e300

void assign(const double *costs, int64_t count, double *work, int64_t *found)
{
    /* Rows and columns count from 1 here; column 0 holds the row that has no column yet. */
    int64_t size = count + 1, *row_of = found, *before = found + size, *is_used = before + size;
    double *row_prices = work, *column_prices = work + size, *slack = column_prices + size;
    memset(work, 0, 3 * size * sizeof *work);
    memset(found, 0, 3 * size * sizeof *found);
    for (int64_t row = 1; row <= count; row++) {
        /* The free column at the end of the cheapest chain of changes, and the column before each one in such chains. */
        int64_t column = 0;
        row_of[0] = row;
        for (int64_t other = 0; other <= count; other++)
            slack[other] = INFINITY, before[other] = is_used[other] = 0;
        while (row_of[column]) {
            int64_t chosen = row_of[column], nearest = 0;
            double least = INFINITY;
            is_used[column] = 1;
            for (int64_t other = 1; other <= count; other++) {
                if (is_used[other])
                    continue;
                double cost = costs[(chosen - 1) * count + other - 1];
                cost = (fabs(cost) < MOST ? cost : MOST) - row_prices[chosen] - column_prices[other];
                if (cost < slack[other])
                    slack[other] = cost, before[other] = column;
                if (slack[other] < least)
                    least = slack[other], nearest = other;
            }
            for (int64_t other = 0; other <= count; other++)
                if (is_used[other])
                    row_prices[row_of[other]] += least, column_prices[other] -= least;
                else
                    slack[other] -= least;
            column = nearest;
        }
        for (; column; column = before[column])
            row_of[column] = row_of[before[column]];
    }
    for (int64_t column = 1; column <= count; column++)
        before[row_of[column] - 1] = column - 1;
}

/* Where a beam ended, unless that is on another robot: then 0. */
static int find_wall(const walls *w, int64_t beam, double *point)
{
    point[0] = w->axes[beam] * w->distances[beam];
    point[1] = w->axes[w->beams + beam] * w->distances[beam];
    for (const double *mate = w->mates; mate < w->mates + 2 * w->count; mate += 2) {
        double x = point[0] - mate[0], y = point[1] - mate[1];
        if (x * x + y * y <= w->body * w->body)
            return 0;
    }
    return 1;
}

void find_sides(const walls *w, double bound, const double *places, int64_t count, double behind, double ahead,
                double side, double *least)
{
    double point[2];
    least[0] = least[1] = INFINITY;
    for (int64_t beam = 0; beam < w->beams; beam++) {
        if (!(w->distances[beam] < bound) || !find_wall(w, beam, point))
            continue;
        for (const double *place = places; place < places + 4 * count; place += 4) {
            double x = point[0] - place[0], y = point[1] - place[1];
            double along = place[2] * x + place[3] * y, across = place[2] * y - place[3] * x, off = fabs(across);
            if (along > -behind && along < ahead && off < side && off > 0.0 && off < least[across < 0.0])
                least[across < 0.0] = off;
        }
    }
}

int is_between(const walls *w, const double *angles, double width, double across, double opposite, double facing)
{
    int64_t first = -1, last = -1, nearest = -1, other = -1;
    double point[2], apart = 0.0;
    for (int64_t beam = 0; beam < w->beams; beam++) {
        if (!(w->distances[beam] < width) || !find_wall(w, beam, point))
            continue;
        first = first < 0 ? beam : first, last = beam;
        if (nearest < 0 || w->distances[beam] < w->distances[nearest])
            nearest = beam;
    }
    for (int64_t beam = first; beam >= 0 && beam <= last; beam++) {
        double turn = angles[beam] - angles[nearest];
        turn = fabs(turn - TAU * rint(turn / TAU));
        if (!(turn > across) || !(w->distances[beam] < (other < 0 ? width : w->distances[other]))
            || !find_wall(w, beam, point))
            continue;
        other = beam, apart = turn;
    }
    if (other < 0 || !(w->distances[nearest] + w->distances[other] < width))
        return 0;
    return apart > (other == first || other == last ? facing : opposite);
}
