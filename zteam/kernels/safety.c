/* What a base meets on an arc, what it remembers of what it saw, and which ways a scan shows as free.
   Points and arcs are metres, metres a second and radians in the frame of the base. */
#include <string.h>
#include "kernels.h"
#include "outlines.h"
#include "sines.h"

/* Radians: an arc that turns less counts as straight. On a metre that is wrong by less than 0.01 mm. */
#define STRAIGHT 1e-5
/* Metres by which the base may come nearer, in each look, to what is nearer than the margin already: it may drive along
   a wall that it does not quite see as straight. */
#define TOUCH 1e-3
/* Metres: nearer than this it may not come so either. Between beams 0.5 degrees apart so much of a corner is unseen. */
#define CLOSEST 2e-3
/* Metres: what is nearer than CLOSEST may come nearer by this, so that rounding stops no base that moves along it. */
#define ROUNDING 1e-6
/* Metres: what numbers are wrong by. */
#define TINY 1e-9
/* Metres that a point may seem to lie behind what a beam met and still be the same. */
#define SEEN_WITHIN 0.05

/* Seconds until a base that drives straight on has a point within `limit` of all half-planes at once. */
static double meet_straight(
    double x, double y, double limit, const double *planes, int64_t sides, double speed_x, double speed_y)
{
    double enters = 0.0, leaves = INFINITY;
    for (const double *plane = planes; plane < planes + 3 * sides; plane += 3) {
        /* Adding 0 makes 0 of -0, which would turn infinities round. */
        double closing = speed_x * plane[0] + speed_y * plane[1] + 0.0;
        double crossed = (plane[0] * x + plane[1] * y - plane[2] - limit) / closing;
        /* A point on the edge of a half-plane that the base moves along is no number, and in it. */
        if (closing < 0.0)
            leaves = crossed < leaves ? crossed : leaves;
        else
            enters = crossed > enters ? crossed : enters;
    }
    return enters <= leaves ? enters : INFINITY;
}

/* Radians until a base that turns about a centre has a point within `limit` of all half-planes at once. */
static double meet_turning(
    double x, double y, double limit, const double *planes, int64_t sides, double centre_x, double centre_y, double side)
{
    double u = x - centre_x, v = y - centre_y, square = u * u + v * v, away = sqrt(square), met = INFINITY;
    if (!(away > TINY))
        return met;
    for (const double *plane = planes; plane < planes + 3 * sides; plane += 3) {
        /* Seen from the base, the point goes round the centre: a cos + b sin of the angle is how far towards the plane.
           Where that is `reach`, and becomes less, the point comes in: at the solution of a quadratic equation. */
        double a = plane[0] * u + plane[1] * v, b = side * (plane[0] * v - plane[1] * u);
        double reach = plane[2] - plane[0] * centre_x - plane[1] * centre_y + limit;
        reach = reach > away ? away : reach < -away ? -away : reach;
        double root = sqrt((away - reach) * (away + reach));
        double cosine = (a * reach - b * root) / square, sine = (b * reach + a * root) / square;
        double there_x = centre_x + cosine * u + side * sine * v, there_y = centre_y + cosine * v - side * sine * u;
        if (depth_of(there_x, there_y, planes, sides) <= limit + TINY) {
            double turned = angle_of(cosine, sine);
            turned = turned < 0.0 ? turned + TAU : turned;
            met = turned < met ? turned : met;
        }
    }
    return met;
}

static int is_within(double x, double y, double radius)
{
    return x * x + y * y <= radius * radius;
}

double meet(
    const double *points, int64_t count, const double *planes, int64_t sides, double speed_x, double speed_y,
    double turn, double seconds, double margin, double x, double y, double radius)
{
    const double centre_x = -speed_y / turn, centre_y = speed_x / turn;
    double first = INFINITY, nearest = INFINITY;
    for (int64_t i = 0; i < count; i++) {
        double px = points[i], py = points[count + i];
        if (is_within(px - x, py - y, radius)) {
            double depth = depth_of(px, py, planes, sides);
            nearest = CLOSEST < depth && depth < nearest ? depth : nearest;
        }
    }
    /* It may move along a wall that is nearer than the margin now: other points of that come as near. */
    margin = margin < nearest ? margin : nearest;
    for (int64_t i = 0; i < count; i++) {
        double px = points[i], py = points[count + i];
        if (!is_within(px - x, py - y, radius))
            continue;
        double depth = depth_of(px, py, planes, sides);
        /* Where it is nearer than the margin now, it may come a little nearer. */
        double limit = depth - ROUNDING < CLOSEST ? depth - ROUNDING : CLOSEST;
        limit = depth - TOUCH > limit ? depth - TOUCH : limit;
        limit = margin < limit ? margin : limit;
        double met = fabs(turn * seconds) < STRAIGHT
            ? meet_straight(px, py, limit, planes, sides, speed_x, speed_y)
            : meet_turning(px, py, limit, planes, sides, centre_x, centre_y, turn < 0.0 ? -1.0 : 1.0) / fabs(turn);
        first = met < first ? met : first;
    }
    return first <= seconds ? first : INFINITY;
}

void move_points(double *points, int64_t count, double x, double y, double turn)
{
    double cosine, sine;
    cosine_sine(turn, &cosine, &sine);
    for (int64_t i = 0; i < count; i++) {
        double ahead = points[i] - x, aside = points[count + i] - y;
        points[i] = cosine * ahead + sine * aside;
        points[count + i] = cosine * aside - sine * ahead;
    }
}

int64_t see(
    const double *known, int64_t count, const double *axes, const double *distances, int64_t beams, double start,
    double step, int64_t few, double x, double y, double yaw, double far, double way, double oldest, double *seen)
{
    const int64_t room = count + beams / few + (beams % few > 0);
    const double stride = fabs(step) > 1e-6 ? step : step < 0.0 ? -1e-6 : 1e-6, circle = rint(TAU / fabs(stride));
    const double around = circle > 1.0 ? circle : 1.0;
    double cosine, sine, *seen_x = seen, *seen_y = seen + room, *seen_at = seen + 2 * room;
    int64_t kept = 0;
    for (int64_t i = 0; i < count; i++) {
        double dx = known[i] - x, dy = known[count + i] - y, away = sqrt(dx * dx + dy * dy);
        double beam = rint((angle_of(dx, dy) - (yaw + start)) / stride);
        beam -= around * floor(beam / around);
        int told = beam >= 0.0 && beam < beams && distances[(int64_t)beam] >= away - SEEN_WITHIN;
        if (!told && away <= far && known[2 * count + i] >= oldest) {
            seen_x[kept] = known[i];
            seen_y[kept] = known[count + i];
            seen_at[kept++] = known[2 * count + i];
        }
    }
    cosine_sine(yaw, &cosine, &sine);
    for (int64_t i = 0; i < beams; i += few) {
        int64_t nearest = -1;
        double distance = far;
        for (int64_t j = i; j < beams && j - i < few; j++)
            if (distances[j] < distance)
                distance = distances[nearest = j];
        if (nearest >= 0) {
            seen_x[kept] = x + distance * (cosine * axes[nearest] - sine * axes[beams + nearest]);
            seen_y[kept] = y + distance * (sine * axes[nearest] + cosine * axes[beams + nearest]);
            seen_at[kept++] = way;
        }
    }
    memmove(seen + kept, seen_y, (size_t)kept * sizeof *seen);
    memmove(seen + 2 * kept, seen_at, (size_t)kept * sizeof *seen);
    return kept;
}

double look_along(
    const double *axes, const double *distances, int64_t beams, double half_width, double heading, double enough)
{
    double cosine, sine, nearest = INFINITY;
    cosine_sine(heading, &cosine, &sine);
    for (int64_t i = 0; i < beams && nearest >= enough; i++)
        if (distances[i] < INFINITY) {
            double hit_x = axes[i] * distances[i], hit_y = axes[beams + i] * distances[i];
            double x = cosine * hit_x + sine * hit_y, y = cosine * hit_y - sine * hit_x;
            nearest = x > 0.0 && x < nearest && fabs(y) <= half_width ? x : nearest;
        }
    return nearest;
}

int64_t first_clear(
    const double *axes, const double *distances, int64_t beams, double half_width, double reach, const double *headings,
    int64_t count)
{
    for (int64_t i = 0; i < count; i++)
        if (look_along(axes, distances, beams, half_width, headings[i], reach) >= reach)
            return i;
    return -1;
}
