/* Rays against polygons, by their edges (docs/benchmarks.md). */
#include "polygons.h"
#include "sines.h"

enum { SECTOR = 8 }; /* beams in a sector of a scan: the farthest range of each rejects what lies behind it */
#define EDGE 1e-12   /* edges reach this far beyond their ends, so that no ray slips through a corner */
#define ROUGH 4e-5   /* radians that the difference of two rough bearings may be off */
#define WIDE 1e-6    /* metres by which a single ray must miss a disc for the disc to be skipped */

/* One scan, and what holds for all its beams. */
typedef struct {
    double x, y, z, yaw, cosine, sine; /* the sensor's pose in `map` */
    double angle_min, increment, slack; /* slack: increments by which the choice of beams may be off */
    int64_t beams;
    const double *cosines, *sines; /* of the beams, in the sensor's frame */
    double *ranges, *tops, far;
    int32_t *hits;
} scan;

/* atan2 to within ROUGH: it only chooses the beams that are then tested exactly. Hastings' polynomial for the arc
   tangent (Abramowitz and Stegun 1964, 4.4.49). */
static double rough_bearing(double y, double x)
{
    double across = fabs(x), along = fabs(y), far = across > along ? across : along;
    double z = far > 0.0 ? (across > along ? along : across) / far : 0.0, s = z * z;
    double angle = z * (0.9998660 + s * (-0.3302995 + s * (0.1801410 + s * (-0.0851330 + s * 0.0208351))));
    angle = along > across ? 0.5 * PI - angle : angle;
    angle = x < 0.0 ? PI - angle : angle;
    return y < 0.0 ? -angle : angle;
}

/* The angle from `start` on to `angle`, 0 to 2 pi. */
static double angle_after(double angle, double start)
{
    double turns = (angle - start) * (1.0 / TAU);
    return (turns - floor(turns)) * TAU;
}

/* First and end beam from `start` (radians after the first beam, 0 to 2 pi; 2 pi less where `turn` is 1) on. */
static void beams_between(const scan *s, double start, double width, int turn, int64_t *begin, int64_t *end)
{
    double low = start - turn * TAU;
    if (s->increment == 0.0) {
        *begin = 0, *end = turn ? 0 : s->beams;
        return;
    }
    *begin = clamped(ceil(low / s->increment - s->slack), s->beams);
    *end = clamped(floor((low + width) / s->increment + s->slack) + 1.0, s->beams);
}

/* Whether a disc lies behind all that the beams towards it have met, or between no beams. */
static int is_hidden(const scan *s, double distance, double bearing, double radius)
{
    double sine = radius / distance, half = sine + (0.5 * PI - 1.0) * sine * sine * sine; /* at least the arc sine */
    double start = angle_after(bearing - half, s->angle_min);
    for (int turn = 0; turn < 2; turn++) {
        int64_t begin, end;
        beams_between(s, start, 2.0 * half, turn, &begin, &end);
        for (int64_t sector = begin / SECTOR; begin < end && sector <= (end - 1) / SECTOR; sector++)
            if (s->tops[sector] > distance - radius)
                return 0;
    }
    return 1;
}

/* Note the longest range of every sector, and of all. */
static void find_tops(scan *s)
{
    s->far = 0.0;
    for (int64_t first = 0; first < s->beams; first += SECTOR) {
        double top = 0.0;
        int count = s->beams - first < SECTOR ? (int)(s->beams - first) : SECTOR;
        for (int i = 0; i < count; i++)
            top = s->ranges[first + i] > top ? s->ranges[first + i] : top;
        s->tops[first / SECTOR] = top;
        s->far = top > s->far ? top : s->far;
    }
}

/* Shorten the ranges of the beams from `begin` to `end` to the edge from u by e, in the sensor's frame. */
static void cast_edge(
    const scan *s, double ux, double uy, double ex, double ey, int64_t begin, int64_t end, int32_t shape)
{
    double cross = ux * ey - uy * ex;
    for (int64_t beam = begin; beam < end; beam++) {
        double c = s->cosines[beam], w = s->sines[beam], denominator = c * ey - w * ex;
        double along = cross / denominator, where = (w * ux - c * uy) / denominator;
        int meets = (fabs(denominator) >= 1e-15) & (along >= 0.0) & (along < s->ranges[beam]);
        if (meets & (where >= -EDGE) & (where <= 1.0 + EDGE)) {
            s->ranges[beam] = along;
            s->hits[beam] = shape;
        }
    }
}

/* Shorten a scan's ranges to one polygon, to 0 in its interior. Of a polygon that the sensor is certainly outside of,
   only edges that face it are met first. */
static void cast_shape(const scan *s, const polygons *o, int32_t shape, int outside)
{
    int32_t first = o->first_vertex[shape], last = o->first_vertex[shape + 1];
    if (!outside && contains(o->x, o->y, first, last, s->x, s->y)) {
        for (int64_t beam = 0; beam < s->beams; beam++)
            if (s->ranges[beam] > 0.0) {
                s->ranges[beam] = 0.0;
                s->hits[beam] = shape;
            }
        return;
    }
    double dx = o->x[last - 1] - s->x, dy = o->y[last - 1] - s->y;
    double ux = s->cosine * dx + s->sine * dy, uy = s->cosine * dy - s->sine * dx, wx, wy;
    for (int32_t vertex = first; vertex < last; vertex++, ux = wx, uy = wy) {
        /* The edge from u to w, in the sensor's frame. */
        dx = o->x[vertex] - s->x, dy = o->y[vertex] - s->y;
        wx = s->cosine * dx + s->sine * dy, wy = s->cosine * dy - s->sine * dx;
        double ex = wx - ux, ey = wy - uy, cross = ux * ey - uy * ex;
        /* No point of the edge is nearer than the line through it; less what rounding may be worth. */
        double near = cross != 0.0 ? (1.0 - 1e-9) * fabs(cross) / sqrt(ex * ex + ey * ey) : 0.0;
        if ((cross >= 0.0 && outside) || !(near <= s->far))
            continue;
        /* Counter-clockwise polygons show their edges clockwise. */
        double u = rough_bearing(uy, ux), w = rough_bearing(wy, wx);
        double right = cross < 0.0 ? w : u, left = cross < 0.0 ? u : w;
        double start = angle_after(right, s->angle_min), width = angle_after(left, right);
        /* An edge seen end on may come out as a full turn for want of digits. */
        width = width > 1.5 * PI ? 0.0 : width;
        for (int turn = 0; turn < 2; turn++) {
            int64_t begin, end;
            beams_between(s, start, width, turn, &begin, &end);
            while (begin < end) {
                /* The sectors from here on that reach as far as the edge, or that do not. */
                int64_t stop = begin;
                int reaches = s->tops[begin / SECTOR] >= near;
                while (stop < end && (s->tops[stop / SECTOR] >= near) == reaches)
                    stop = (stop / SECTOR + 1) * SECTOR < end ? (stop / SECTOR + 1) * SECTOR : end;
                if (reaches)
                    cast_edge(s, ux, uy, ex, ey, begin, stop, shape);
                begin = stop;
            }
        }
    }
}

/* Shorten a scan's ranges to the shapes of one group. */
static void cast_group(const scan *s, const polygons *o, int32_t group)
{
    double dx = o->centre_x[group] - s->x, dy = o->centre_y[group] - s->y, radius = o->radius[group];
    double square = dx * dx + dy * dy, distance = sqrt(square);
    if (square > (s->far + radius) * (s->far + radius))
        return;
    if (s->beams == 1) {
        /* Where a lone ray goes. */
        double ux = s->cosine * s->cosines[0] - s->sine * s->sines[0];
        double uy = s->sine * s->cosines[0] + s->cosine * s->sines[0];
        if (fabs(ux * dy - uy * dx) > radius + WIDE || ux * dx + uy * dy < -radius - WIDE)
            return;
    }
    int outside = distance > radius;
    if (outside && is_hidden(s, distance, rough_bearing(dy, dx) - s->yaw, radius))
        return;
    for (int32_t shape = o->first_shape[group]; shape < o->first_shape[group + 1]; shape++)
        if (o->z_min[shape] <= s->z && s->z <= o->z_max[shape])
            cast_shape(s, o, shape, outside);
}

void cast_edges(const polygons *o, const fans *all)
{
    scan s = {.angle_min = all->angle_min, .increment = all->increment, .beams = all->beams, .tops = all->tops};
    s.slack = all->jitter + 1e-6 + (all->increment > 0.0 ? ROUGH / all->increment : 0.0);
    for (int64_t i = 0; i < all->count && all->beams > 0; i++) {
        int64_t table = all->tables > 1 ? i * all->beams : 0;
        s.x = all->x[i], s.y = all->y[i], s.z = all->z[i], s.yaw = all->yaw[i];
        s.cosines = all->cosine + table, s.sines = all->sine + table;
        s.ranges = all->ranges + i * all->beams, s.hits = all->hits + i * all->beams;
        cosine_sine(s.yaw, &s.cosine, &s.sine);
        if (!isfinite(s.x + s.y + s.cosine + s.sine))
            continue;
        find_tops(&s);
        walk near = walk_near(o, s.x, s.y, s.far + o->reach);
        for (int32_t group; (group = next_group(o, &near)) >= 0;)
            if (o->owner[group] != all->owner[i] || all->owner[i] < 0)
                cast_group(&s, o, group);
    }
}
