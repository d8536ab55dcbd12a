/* What a robot's view is read with: poses of others, ranges of scans, and which ways a scan shows as free. */
#include "kernels.h"
#include "sines.h"

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
