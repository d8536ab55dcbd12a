/* What a robot's view is read with: poses of others, ranges of scans, and which ways a scan shows as free. */
#include "kernels.h"
#include "sines.h"

void see_poses(const double *poses, int64_t count, int64_t own, double *seen)
{
    double cosine, sine, x = poses[3 * own], y = poses[3 * own + 1], yaw = poses[3 * own + 2];
    cosine_sine(yaw, &cosine, &sine);
    for (int64_t i = 0; i < 3 * count; i += 3) {
        double dx = poses[i] - x, dy = poses[i + 1] - y, turn = poses[i + 2] - yaw;
        seen[i] = cosine * dx + sine * dy;
        seen[i + 1] = cosine * dy - sine * dx;
        seen[i + 2] = turn - TAU * rint(turn / TAU);
    }
}

int64_t read_ranges(double *ranges, int64_t count, double least, double most, double *nearest)
{
    const double low = least <= 0.0 ? 5e-324 : least * (1.0 - 1e-6), high = most * (1.0 + 1e-6), free = most * (1.0 - 1e-6);
    int64_t silent = 0;
    double found = INFINITY;
    for (int64_t i = 0; i < count; i++) {
        double range = ranges[i];
        int says = ((range >= low) & (range <= high)) | (fabs(range) == INFINITY);
        range = says ? range : NAN;
        range = range >= free ? INFINITY : range;
        ranges[i] = range < 0.0 ? 0.0 : range;
    }
    for (int64_t i = 0; i < count; i++) {
        silent += ranges[i] != ranges[i];
        found = ranges[i] < found ? ranges[i] : found;
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
