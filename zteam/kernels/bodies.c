/* What moves and what it meets: polygons that are carried along, and overlap or not. */
#include "polygons.h"
#include "sines.h"

enum {
    BINS = 64, FEW = 32,           /* bins along x and along y at most; up to so many groups there is one */
    HALVINGS = 6, ROUNDS = 4,      /* of the piece of a way in which a core was stopped; over all bodies */
    MOST_PLACES = 1000,            /* along one way that are tested */
};
#define BIN 3.0      /* least size of a bin in metres */
#define TOUCH 1e-9   /* metres that polygons may overlap and still only touch */
#define STRIDE 0.1   /* metres, and radians, between the places along a move that are tested */

static double least(double a, double b)
{
    return a < b ? a : b;
}

static double most(double a, double b)
{
    return a > b ? a : b;
}

/* Place a group with its mover at a share of the way from a pose to another; its bin stays as it is. */
static void place_group(polygons *o, int32_t group, const double *pose, const double *end, double share)
{
    double at[3], c, s;
    for (int axis = 0; axis < 3; axis++)
        at[axis] = share == 1.0 ? end[axis] : pose[axis] + share * (end[axis] - pose[axis]);
    cosine_sine(at[2], &c, &s);
    const double *centre = o->local_centre + 2 * group;
    o->centre_x[group] = at[0] + c * centre[0] - s * centre[1];
    o->centre_y[group] = at[1] + s * centre[0] + c * centre[1];
    for (int32_t i = o->first_vertex[o->first_shape[group]]; i < o->first_vertex[o->first_shape[group + 1]]; i++) {
        o->x[i] = at[0] + c * o->local_x[i] - s * o->local_y[i];
        o->y[i] = at[1] + s * o->local_x[i] + c * o->local_y[i];
    }
}

/* The bin of a group's centre; the last one for a group that is wider than a bin. */
static int32_t bin_of(const polygons *o, int32_t group)
{
    if (o->radius[group] > o->bin_size)
        return o->rows * o->columns;
    return bin_at(o, o->centre_y[group], o->bin_y, o->rows) * o->columns
        + bin_at(o, o->centre_x[group], o->bin_x, o->columns);
}

/* Bring the groups of movers to `poses` (movers; x, y, yaw in `map`), and sort all groups by the bin of their centre:
   a counting sort, so groups of one bin stay in order. */
void move_polygons(polygons *o, const double *poses)
{
    double left = INFINITY, right = -INFINITY, low = INFINITY, high = -INFINITY;
    for (int32_t group = 0; group < o->groups; group++) {
        if (o->owner[group] >= 0) {
            const double *pose = poses + 3 * o->owner[group];
            place_group(o, group, pose, pose, 1.0);
        }
        left = least(left, o->centre_x[group]), right = most(right, o->centre_x[group]);
        low = least(low, o->centre_y[group]), high = most(high, o->centre_y[group]);
    }
    o->rows = o->columns = 1;
    o->bin_x = o->bin_y = o->reach = 0.0;
    o->bin_size = 1e12;
    if (o->groups > FEW && isfinite(right - left + high - low)) {
        o->bin_size = most(BIN, most(right - left, high - low) / BINS);
        o->bin_x = left, o->bin_y = low;
        o->columns = (int32_t)clamped((right - left) / o->bin_size, BINS - 1) + 1;
        o->rows = (int32_t)clamped((high - low) / o->bin_size, BINS - 1) + 1;
    }
    int32_t count = o->rows * o->columns + 1;
    for (int32_t i = 0; i <= count; i++)
        o->bin_start[i] = 0;
    for (int32_t group = 0; group < o->groups; group++) {
        int32_t place = bin_of(o, group);
        o->bin_start[place + 1]++;
        if (place < count - 1)
            o->reach = most(o->reach, o->radius[group]);
    }
    for (int32_t i = 0; i < count; i++)
        o->bin_start[i + 1] += o->bin_start[i];
    for (int32_t group = 0; group < o->groups; group++)
        o->in_bin[o->bin_start[bin_of(o, group)]++] = group;
    for (int32_t i = count; i > 0; i--)
        o->bin_start[i] = o->bin_start[i - 1];
    o->bin_start[0] = 0;
}

/* Whether an edge of the convex polygon of vertices a to b has all vertices c to d on its outer side. */
static int is_beside(const polygons *o, int32_t a, int32_t b, int32_t c, int32_t d)
{
    for (int32_t i = a, j = b - 1; i < b; j = i++) {
        double ex = o->x[i] - o->x[j], ey = o->y[i] - o->y[j], inner = TOUCH * sqrt(ex * ex + ey * ey);
        int beside = inner > 0.0;
        for (int32_t k = c; beside && k < d; k++)
            beside = !(ex * (o->y[k] - o->y[j]) - ey * (o->x[k] - o->x[j]) > inner);
        if (beside)
            return 1;
    }
    return 0;
}

/* Whether shapes of two groups overlap: no edge of a shape parts them. Touching is not overlapping. */
static int groups_overlap(const polygons *o, int32_t one, int32_t other)
{
    double dx = o->centre_x[one] - o->centre_x[other], dy = o->centre_y[one] - o->centre_y[other];
    double reach = o->radius[one] + o->radius[other];
    if (dx * dx + dy * dy >= reach * reach)
        return 0;
    for (int32_t i = o->first_shape[one]; i < o->first_shape[one + 1]; i++)
        for (int32_t j = o->first_shape[other]; j < o->first_shape[other + 1]; j++) {
            int32_t a = o->first_vertex[i], b = o->first_vertex[i + 1];
            int32_t c = o->first_vertex[j], d = o->first_vertex[j + 1];
            if (o->z_min[i] < o->z_max[j] && o->z_min[j] < o->z_max[i] && !is_beside(o, a, b, c, d)
                && !is_beside(o, c, d, a, b))
                return 1;
        }
    return 0;
}

/* Whether a polygon covers part of an occupied cell. */
static int shape_meets_bitmap(const polygons *o, int32_t shape, const bitmap *map)
{
    double c, s, left = INFINITY, bottom = INFINITY, right = -INFINITY, top = -INFINITY;
    double *px = o->corner_x, *py = o->corner_y;
    int32_t begin = o->first_vertex[shape], count = o->first_vertex[shape + 1] - begin;
    cosine_sine(map->yaw, &c, &s);
    for (int32_t i = 0; i < count; i++) {
        double dx = o->x[begin + i] - map->x, dy = o->y[begin + i] - map->y;
        px[i] = (c * dx + s * dy) / map->cell_x, py[i] = (c * dy - s * dx) / map->cell_y;
        left = least(left, px[i]), right = most(right, px[i]), bottom = least(bottom, py[i]), top = most(top, py[i]);
    }
    if (!(right > 0.0 && top > 0.0 && left < (double)map->columns && bottom < (double)map->rows))
        return 0;
    int64_t first_x = clamped(left, map->columns - 1), last_x = clamped(right, map->columns - 1);
    int64_t first_y = clamped(bottom, map->rows - 1), last_y = clamped(top, map->rows - 1);
    int64_t size = last_x - first_x > last_y - first_y ? last_x - first_x : last_y - first_y;
    if (map->sides[first_y * map->columns + first_x] > size)
        return 0;
    for (int64_t y = first_y; y <= last_y; y++)
        for (int64_t x = first_x; x <= last_x; x++)
            if (!map->sides[y * map->columns + x] && meets_cell(px, py, count, (double)x, (double)y, 0.0, 0))
                return 1;
    return 0;
}

/* Whether a group overlaps a bitmap, what stands still or, with `apart`, another mover but the `ignored` (movers, or
   NULL) where it has been placed. Bins are up to `slack` metres out of date. */
static int overlaps(
    const polygons *o, int32_t group, const bitmap *maps, int64_t count, double slack, int apart, const uint8_t *ignored)
{
    for (int64_t k = 0; k < count; k++)
        for (int32_t shape = o->first_shape[group]; shape < o->first_shape[group + 1]; shape++)
            if (o->z_min[shape] < maps[k].z_max && maps[k].z_min < o->z_max[shape]
                && shape_meets_bitmap(o, shape, maps + k))
                return 1;
    walk near = walk_near(o, o->centre_x[group], o->centre_y[group], o->radius[group] + o->reach + slack);
    for (int32_t other; (other = next_group(o, &near)) >= 0;) {
        int64_t owner = o->owner[other];
        int counts = owner < 0 || (apart && !(ignored && ignored[owner]));
        if (other != group && counts && groups_overlap(o, group, other))
            return 1;
    }
    return 0;
}

/* Which movers overlap something where they have been placed. */
void find_overlaps(const polygons *o, const bitmap *maps, int64_t count, int apart, uint8_t *found)
{
    for (int32_t group = 0; group < o->groups; group++)
        if (o->owner[group] >= 0)
            found[o->owner[group]] = (uint8_t)overlaps(o, group, maps, count, 0.0, apart, NULL);
}

/* Move the first `robots` movers, in order, from `poses` to `ends` (movers; x, y, yaw). A move that meets something is
   `blocked`, and not made at all. All groups have been placed at `poses`. */
void move_all(polygons *o, const bitmap *maps, int64_t count, int64_t robots, double *poses, const double *ends,
              uint8_t *blocked)
{
    double slack = 0.0;
    for (int round = 0; round < 2; round++)
        for (int32_t group = 0; group < o->groups; group++) {
            int64_t i = o->owner[group];
            if (i < 0 || i >= robots)
                continue;
            double *pose = poses + 3 * i;
            const double *end = ends + 3 * i, *centre = o->local_centre + 2 * group;
            double dx = end[0] - pose[0], dy = end[1] - pose[1], turn = fabs(end[2] - pose[2]);
            double way = sqrt(dx * dx + dy * dy), arm = sqrt(centre[0] * centre[0] + centre[1] * centre[1]);
            if (round == 0) {
                /* A turn about the base's origin swings the centre of the group. */
                slack = most(slack, way + arm * turn);
                continue;
            }
            blocked[i] = !isfinite(way + turn);
            int64_t places = 1 + clamped(most(way, most(1.0, arm) * turn) / STRIDE, MOST_PLACES - 1);
            for (int64_t k = 1; k <= places && !blocked[i] && way + turn > 0.0; k++) {
                place_group(o, group, pose, end, (double)k / (double)places);
                blocked[i] = (uint8_t)overlaps(o, group, maps, count, slack, 1, NULL);
            }
            if (blocked[i])
                place_group(o, group, pose, pose, 1.0);
            for (int axis = 0; axis < 3 && !blocked[i]; axis++)
                pose[axis] = end[axis];
        }
}

/* How far, from `share` on, a group's way is free; the group is placed there. */
static double advance(
    polygons *o, int32_t group, const bitmap *maps, int64_t count, double slack, int apart, const uint8_t *ignored,
    const double *pose, const double *end, double share, double places)
{
    double free = share, blocked = 2.0, tested = 0.0;
    for (int halvings = 0; free < 1.0 && halvings < HALVINGS;) {
        double at;
        if (blocked > 1.0) {
            tested += 1.0;
            at = tested >= places ? 1.0 : share + (1.0 - share) * tested / places;
        } else {
            halvings++;
            at = 0.5 * (free + blocked);
        }
        place_group(o, group, pose, end, at);
        if (overlaps(o, group, maps, count, slack, apart, ignored))
            blocked = at;
        else
            free = at;
    }
    if (free < 1.0)
        place_group(o, group, pose, end, free);
    return free;
}

/* Number the places to test along each suspect's way, and set `shares` to 0 for it; return the longest way of any point
   of a body in metres. A way to a place that is not finite is none. */
static double measure_ways(const polygons *o, const double *half, const double *poses, double *ends,
                           const uint8_t *suspects, double *places, double *shares)
{
    double longest = 0.0;
    for (int32_t group = 0; group < o->groups; group++) {
        int64_t i = o->owner[group];
        if (i < 0)
            continue;
        const double *pose = poses + 3 * i, *centre = o->local_centre + 2 * group;
        double *end = ends + 3 * i, dx = end[0] - pose[0], dy = end[1] - pose[1], turn = fabs(end[2] - pose[2]);
        double arm = sqrt(centre[0] * centre[0] + centre[1] * centre[1]);
        double way = sqrt(dx * dx + dy * dy) + (arm + o->radius[group]) * turn;
        if (!isfinite(way)) {
            shares[i] = 0.0;
            end[0] = pose[0], end[1] = pose[1], end[2] = pose[2];
        } else if (suspects[i] && (dx != 0.0 || dy != 0.0 || turn != 0.0)) {
            longest = most(longest, way);
            places[i] = 1.0 + (double)clamped(way / half[group], MOST_PLACES);
            shares[i] = 0.0;
        }
    }
    return longest;
}

/* Cut the ways of the `suspects` from `poses` to `ends` (movers; x, y, yaw) to what is free; `shares` is how much.
   `half` (groups) is half the width of a core: no two places that are tested are farther apart. With `apart` cores stay
   out of each other too, unless both are `tangled`. All groups have been placed at `poses`. */
void hold(polygons *o, const bitmap *maps, int64_t count, const double *half, const double *poses, double *ends,
          const uint8_t *suspects, const uint8_t *tangled, int apart, double *places, double *shares)
{
    for (int32_t i = 0; i < o->movers; i++)
        places[i] = 0.0, shares[i] = 1.0;
    double slack = measure_ways(o, half, poses, ends, suspects, places, shares);
    for (int round = 0, went = 1; round < ROUNDS && went; round++) {
        went = 0;
        /* What is pushed goes before what pushes it: robots come first in the order of movers. */
        for (int32_t group = o->groups - 1; group >= 0; group--) {
            int64_t i = o->owner[group];
            if (i < 0 || shares[i] >= 1.0 || places[i] == 0.0)
                continue;
            double share = shares[i];
            shares[i] = advance(o, group, maps, count, slack, apart, tangled[i] ? tangled : NULL, poses + 3 * i,
                                ends + 3 * i, share, places[i]);
            went |= shares[i] > share;
        }
    }
    for (int32_t i = 0; i < o->movers; i++)
        for (int axis = 0; axis < 3 && places[i] > 0.0 && shares[i] < 1.0; axis++) {
            double begin = poses[3 * i + axis];
            ends[3 * i + axis] = begin + shares[i] * (ends[3 * i + axis] - begin);
        }
}
