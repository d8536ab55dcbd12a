/* Bases: what they make of their commands, where they go, and what they did. */
#include "kernels.h"
#include "sines.h"

static double within(double value, double low, double high)
{
    value = value > low ? value : low;
    return value < high ? value : high;
}

/* Change the setpoints towards the commands as far as the limits allow in `seconds`; a command that is not fresh is 0.
   A car's angular command is Stage's: the angle of the steered wheels, v sin(angle) / wheelbase the yaw rate. While a
   car gathers or loses speed it turns no more sharply than its wheels are steered. */
void obey(bases *b, const double *commands, const uint8_t *fresh, double seconds)
{
    for (int64_t i = 0; i < b->robots; i++) {
        double *setpoint = b->setpoint + 3 * i, goal[3], c, s;
        /* Yaw rate over speed, as commanded; while a car comes to a stand, as it was. */
        double bend = setpoint[0] != 0.0 ? fabs(setpoint[2] / setpoint[0]) : 0.0;
        for (int axis = 0; axis < 3; axis++)
            goal[axis] = commands[3 * i + axis];
        if (b->is_car[i]) {
            cosine_sine(goal[2], &c, &s);
            goal[2] = goal[0] * s / b->wheelbase[i];
            goal[0] *= c;
        }
        for (int axis = 0; axis < 3; axis++) {
            int64_t k = 3 * i + axis;
            goal[axis] = fresh[i] ? within(goal[axis], b->low[k], b->high[k]) : 0.0;
            setpoint[axis] = within(goal[axis], setpoint[axis] + b->slow[k] * seconds,
                                    setpoint[axis] + b->fast[k] * seconds);
        }
        if (b->is_car[i]) {
            bend = goal[0] != 0.0 ? fabs(goal[2] / goal[0]) : bend;
            double most = bend * fabs(setpoint[0]) * (1.0 + 1e-12);
            setpoint[2] = within(setpoint[2], -most, most);
        }
    }
}

/* Where robots at `poses` (x, y, yaw) get to at constant body velocity: on the exact arc or, with `tangents`, as Stage
   steps (Euler): straight ahead by the old heading, then the turn. */
void follow(int64_t robots, const double *poses, const double *velocity, double seconds, int tangents, double *ends)
{
    for (int64_t i = 0; i < 3 * robots; i += 3) {
        double turn = velocity[i + 2] * seconds, half = tangents ? 0.0 : 0.5 * turn, c, s, chord = seconds, aside;
        /* The chord of the arc: sin(half) / half long, half the turn to the side. */
        if (fabs(half) > 1e-9) {
            cosine_sine(half, &aside, &s);
            chord *= s / half;
        }
        cosine_sine(poses[i + 2] + half, &c, &s);
        ends[i] = poses[i] + c * chord * velocity[i] - s * chord * velocity[i + 1];
        ends[i + 1] = poses[i + 1] + s * chord * velocity[i] + c * chord * velocity[i + 1];
        ends[i + 2] = poses[i + 2] + turn;
    }
}

/* Note what the bases did from `before` to `after` (robots; x, y, yaw): the velocity of the arcs (or of Stage's steps,
   with `tangents`) that lead there, the way since the start, and the wheels' turns. */
void note_motion(bases *b, const double *before, const double *after, double seconds, int tangents)
{
    for (int64_t i = 0; i < 3 * b->robots; i += 3) {
        double *velocity = b->velocity + i, *odom = b->odom + i, c, s, stretch = 1.0, aside;
        double turn = after[i + 2] - before[i + 2], half = tangents ? 0.0 : 0.5 * turn;
        /* The way made good, seen from half the turn and stretched from the chord to the arc. */
        if (fabs(half) > 1e-9) {
            cosine_sine(half, &aside, &s);
            stretch = half / s;
        }
        cosine_sine(before[i + 2] + half, &c, &s);
        double dx = after[i] - before[i], dy = after[i + 1] - before[i + 1];
        velocity[0] = (c * dx + s * dy) * stretch / seconds;
        velocity[1] = (c * dy - s * dx) * stretch / seconds;
        velocity[2] = turn / seconds;
        cosine_sine(b->start[i + 2], &c, &s);
        dx = after[i] - b->start[i], dy = after[i + 1] - b->start[i + 1];
        odom[0] = c * dx + s * dy, odom[1] = c * dy - s * dx, odom[2] = after[i + 2] - b->start[i + 2];
    }
    for (int64_t i = 0; i < b->wheels; i++) {
        const double *row = b->wheel_rows + 3 * i, *velocity = b->velocity + 3 * b->wheel_owner[i];
        b->rates[i] = row[0] * velocity[0] + row[1] * velocity[1] + row[2] * velocity[2];
        b->angles[i] += b->rates[i] * seconds;
    }
}

/* Where sensors (rows x, y, yaw; in the base frame) are with their owners at `poses` (robots; x, y, yaw); return whether
   all owners are there. */
int place_mounts(
    int64_t count, const int64_t *owner, const double *mounts, int64_t robots, const double *poses, double *rays)
{
    for (int64_t i = 0; i < count; i++) {
        if (owner[i] < 0 || owner[i] >= robots)
            return 0;
        const double *pose = poses + 3 * owner[i], u = mounts[i], v = mounts[count + i];
        double c, s;
        cosine_sine(pose[2], &c, &s);
        rays[i] = pose[0] + c * u - s * v;
        rays[count + i] = pose[1] + s * u + c * v;
        rays[2 * count + i] = pose[2] + mounts[2 * count + i];
    }
    return 1;
}
