/* What a robot's view is read with: poses of others, ranges of scans, and which ways a scan shows as free. */
#include "kernels.h"
#include "sines.h"

#define LEAST(a, b) ((a) < (b) ? (a) : (b))
#define MOST(a, b) ((a) > (b) ? (a) : (b))

void see_poses(const double *poses, int64_t count, int64_t own, double *seen)
{
    const double *here = poses + 4 * own;
    double cosine, sine;
    cosine_sine(here[2], &cosine, &sine);
    for (const double *pose = poses; pose < poses + 4 * count; pose += 4) {
        double dx = pose[0] - here[0], dy = pose[1] - here[1], turn = pose[2] - here[2];
        *seen++ = cosine * dx + sine * dy;
        *seen++ = cosine * dy - sine * dx;
        *seen++ = turn - TAU * rint(turn / TAU);
    }
}

int64_t read_ranges(const float *ranges, int64_t count, double least, double most, double closest, double *distances,
                    double *nearest)
{
    const double low = least <= 0.0 ? 5e-324 : least * (1.0 - 1e-6), high = most * (1.0 + 1e-6);
    const double free = most * (1.0 - 1e-6);
    int64_t silent = 0;
    double found = INFINITY;
    for (int64_t i = 0; i < count; i++) {
        double range = ranges[i];
        int says = ((range >= low) & (range <= high)) | (fabs(range) == INFINITY);
        range = says ? range : NAN;
        range = range >= free ? INFINITY : range;
        distances[i] = range < closest ? closest : range;
    }
    for (int64_t i = 0; i < count; i++) {
        silent += distances[i] != distances[i];
        found = distances[i] < found ? distances[i] : found;
    }
    *nearest = found;
    return silent;
}

double look_along(const laser_scan *seen, double half_width, double heading, double enough)
{
    const double *axes = seen->axes, *distances = seen->distances;
    double cosine, sine, nearest = INFINITY;
    cosine_sine(heading, &cosine, &sine);
    for (int64_t i = 0; i < seen->beams && nearest >= enough; i++)
        if (distances[i] < INFINITY) {
            double hit_x = axes[i] * distances[i], hit_y = axes[seen->beams + i] * distances[i];
            double x = cosine * hit_x + sine * hit_y, y = cosine * hit_y - sine * hit_x;
            nearest = x > 0.0 && x < nearest && fabs(y) <= half_width ? x : nearest;
        }
    return nearest;
}

int64_t first_clear(const laser_scan *seen, double half_width, double reach, const double *headings, int64_t count)
{
    for (int64_t i = 0; i < count; i++)
        if (look_along(seen, half_width, headings[i], reach) >= reach)
            return i;
    return -1;
}

/* Whether a point lies on a teammate, or up to `margin` beside it. */
static int is_on(const double *mates, int64_t count, double margin, double x, double y)
{
    for (const double *mate = mates; mate < mates + 3 * count; mate += 3)
        if (sqrt((x - mate[0]) * (x - mate[0]) + (y - mate[1]) * (y - mate[1])) <= mate[2] + margin)
            return 1;
    return 0;
}

int64_t find_ends(const planar_scan *s, const double *base, double far, int64_t wanted, const double *mates,
                  int64_t mate_count, double margin, double *laser, double *ends, uint8_t *met)
{
    double *distances = ends + 2 * s->beams, nearest, cosine, sine;
    const double most = LEAST(s->most, far), first = s->start + base[2] + s->yaw;
    int64_t count = 0;
    cosine_sine(base[2], &cosine, &sine);
    laser[0] = base[0] + cosine * s->x - sine * s->y, laser[1] = base[1] + sine * s->x + cosine * s->y;
    read_ranges(s->ranges, s->beams, s->least, s->most, 0.0, distances, &nearest);
    for (int64_t k = 0; k < wanted; k++) {
        const int64_t i = wanted < s->beams ? k * (s->beams - 1) / MOST(wanted - 1, 1) : k;
        ends[2 * k] = first + s->step * (double)i;
        distances[k] = distances[i];
    }
    for (int64_t k = 0; k < wanted; k++)
        cosine_sine(ends[2 * k], ends + 2 * k, ends + 2 * k + 1);
    for (int64_t k = 0; k < wanted; k++) {
        const double distance = distances[k], length = LEAST(distance, most);
        /* What is not a number is not above 0 either. */
        if (!(distance > 0.0))
            continue;
        const double x = laser[0] + length * ends[2 * k], y = laser[1] + length * ends[2 * k + 1];
        ends[2 * count] = x, ends[2 * count + 1] = y;
        met[count++] = distance <= far && !is_on(mates, mate_count, margin, x, y);
    }
    return count;
}

int64_t find_hits(const planar_scan *s, const double *base, double far, int64_t wanted, const double *mates,
                  int64_t mate_count, double margin, double *ends, uint8_t *met)
{
    double laser[2];
    const int64_t found = find_ends(s, base, far, wanted, mates, mate_count, margin, laser, ends, met);
    int64_t count = 0;
    for (int64_t i = 0; i < found; i++)
        if (met[i])
            ends[2 * count] = ends[2 * i], ends[2 * count + 1] = ends[2 * i + 1], count++;
    return count;
}
