/* Points joined by straight pieces, and the way of a robot that leads, drawn through poses that may be noisy. */
#include <stdlib.h>
#include <string.h>
#include "kernels.h"
#include "sines.h"

/* Metres: a nearer point is the same point, because its direction would be rounding. */
#define LEAST 1e-9

static double length(double x, double y)
{
    return sqrt(x * x + y * y);
}

/* `low` if s is no number. */
static double clamp(double s, double low, double high)
{
    return s > low ? (s < high ? s : high) : low;
}

static double *row(const polyline *p, int64_t i)
{
    return p->rows + 3 * (p->first + i);
}

/* The index of the point at which the piece around `s` begins. There are at least two points. */
static int64_t find_piece(const polyline *p, double s)
{
    int64_t low = 0, high = p->count - 1;
    while (low + 1 < high) {
        int64_t middle = (low + high) / 2;
        if (row(p, middle)[2] <= s)
            low = middle;
        else
            high = middle;
    }
    return low;
}

/* The point at `s` on the piece that ends at this row. */
static void point_on(const double *end, double s, double *point)
{
    const double *begin = end - 3;
    double share = end[2] > begin[2] ? (s - begin[2]) / (end[2] - begin[2]) : 0.0;
    point[0] = begin[0] + share * (end[0] - begin[0]);
    point[1] = begin[1] + share * (end[1] - begin[1]);
}

void free_points(polyline *p)
{
    free(p->rows);
}

int append_point(polyline *p, double x, double y)
{
    double end = p->end;
    if (p->count) {
        const double *last = row(p, p->count - 1);
        end += length(x - last[0], y - last[1]);
        if (!(end - p->end >= LEAST))
            return 1;
    }
    if (!isfinite(x) || !isfinite(y) || !isfinite(end))
        return 1;
    if (p->first + p->count == p->room) {
        if (2 * p->first > p->count) {
            memmove(p->rows, row(p, 0), 3 * p->count * sizeof *p->rows);
            p->first = 0;
        } else {
            int64_t room = 2 * p->room + 16;
            double *rows = realloc(p->rows, 3 * room * sizeof *rows);
            if (!rows)
                return 0;
            p->rows = rows, p->room = room;
        }
    }
    double *made = row(p, p->count++);
    made[0] = x, made[1] = y, made[2] = p->end = end;
    return 1;
}

void drop_before(polyline *p, double s)
{
    p->start = clamp(s, p->start, p->end);
    if (p->count > 1) {
        int64_t dropped = find_piece(p, p->start);
        p->first += dropped, p->count -= dropped;
    }
}

void cut_after(polyline *p, double s)
{
    s = clamp(s, p->start, p->end);
    if (p->count < 2 || s >= p->end)
        return;
    int64_t piece = find_piece(p, s);
    double end[2];
    point_on(row(p, piece + 1), s, end);
    p->count = piece + 1;
    p->end = row(p, piece)[2];
    append_point(p, end[0], end[1]);
}

int find_pose(const polyline *p, double s, double *pose)
{
    pose[0] = pose[1] = pose[2] = 0.0;
    if (p->count < 2) {
        if (p->count)
            memcpy(pose, row(p, 0), 2 * sizeof *pose);
        return p->count > 0;
    }
    s = clamp(s, p->start, p->end);
    const double *end = row(p, find_piece(p, s) + 1);
    point_on(end, s, pose);
    pose[2] = angle_of(end[0] - end[-3], end[1] - end[-2]);
    return 1;
}

int find_nearest(const polyline *p, double x, double y, double low, double high, double *found)
{
    if (!p->count)
        return 0;
    low = clamp(low, p->start, p->end);
    high = clamp(high, low, p->end);
    double from[3] = {row(p, 0)[0], row(p, 0)[1], low}, least = INFINITY;
    int64_t piece = 0, last = 0;
    if (p->count > 1) {
        piece = find_piece(p, low), last = find_piece(p, high);
        point_on(row(p, piece + 1), low, from);
    }
    found[0] = low;
    for (; piece <= last; piece++) {
        double to[3] = {from[0], from[1], high};
        if (piece < last)
            memcpy(to, row(p, piece + 1), sizeof to);
        else if (p->count > 1)
            point_on(row(p, piece + 1), high, to);
        double along_x = to[0] - from[0], along_y = to[1] - from[1], off_x = x - from[0], off_y = y - from[1];
        double along = off_x * along_x + off_y * along_y, square = along_x * along_x + along_y * along_y;
        double share = along > 0.0 ? (along < square ? along / square : 1.0) : 0.0;
        off_x -= share * along_x, off_y -= share * along_y;
        double off = off_x * off_x + off_y * off_y;
        if (off < least) {
            least = off;
            found[0] = from[2] + share * (to[2] - from[2]);
        }
        memcpy(from, to, sizeof from);
    }
    found[1] = sqrt(least);
    return 1;
}

double find_beside(const polyline *p, double x, double y, double within, double low, double high)
{
    for (int64_t i = 0; i < p->count; i++) {
        const double *at = row(p, i);
        if (at[2] >= low && at[2] < high && length(at[0] - x, at[1] - y) < within)
            return at[2];
    }
    return high;
}

/* Radians: a robot turns on the spot while the point that it drives to is further to the side; 1/s: by that angle. */
#define TURN_ON_THE_SPOT 1.0
#define TURN_GAIN 4.0
/* Metres: a nearer point tells no direction. */
#define NEAR 0.02

int pursue(const polyline *p, const double *pose, double s, double ahead, double speed, const double *limits,
           double *velocity)
{
    double to[3], cosine, sine, beyond = s + ahead - p->end;
    velocity[0] = velocity[1] = 0.0;
    if (!find_pose(p, s + ahead, to))
        return 0;
    if (beyond > 0.0) {
        cosine_sine(to[2], &cosine, &sine);
        to[0] += beyond * cosine, to[1] += beyond * sine;
    }
    double off_x = to[0] - pose[0], off_y = to[1] - pose[1];
    double x = pose[2] * off_x + pose[3] * off_y, y = pose[2] * off_y - pose[3] * off_x, square = x * x + y * y;
    /* The path goes on, back past this place. */
    if (square < NEAR * NEAR && beyond < 0.0 && ahead > 0.0)
        return pursue(p, pose, s, 2.0 * ahead, speed, limits, velocity);
    if (square < NEAR * NEAR || speed <= 0.0)
        return 1;
    double angle = angle_of(x, y), curvature = 2.0 * y / square, bend = fabs(curvature);
    if (fabs(angle) > TURN_ON_THE_SPOT) {
        velocity[1] = clamp(TURN_GAIN * angle, -limits[1], limits[1]);
        return 1;
    }
    speed = speed < limits[0] ? speed : limits[0];
    speed = speed * bend > limits[1] ? limits[1] / bend : speed;
    velocity[0] = speed * speed * bend > limits[2] ? sqrt(limits[2] / bend) : speed;
    velocity[1] = velocity[0] * curvature;
    return 1;
}

/* Metres between two points of the trail. */
#define SPACING 0.1
/* Metres of the way before and behind a point of the trail whose poses tell where it is: without noise, and at most. */
#define REACH 0.1
#define MOST_REACH 0.25
/* Metres that the leader has to come forward for its next pose to tell something of the trail. */
#define STEP 0.01
/* Metres that the leader backs up behind the trail's end before its trail is cut. */
#define REVERSE 0.05
/* Metres beside its trail at which it backs up another way. */
#define BESIDE 0.2
/* Metres from one pose to the next: along so much of the trail's end it may back up, and what is further was moved. */
#define JUMP 1.0
/* Metres on either side between which a direction is measured. */
#define CHORD 0.1
/* Of the alpha-beta filter: critically damped. */
#define PLACE_GAIN 0.75
#define SPEED_GAIN 0.25
/* How fast the mean deviation of a pose from the place that was expected is learnt; metres that it is at least. */
#define NOISE_GAIN 0.05
#define LEAST_NOISE 0.002
/* So many mean deviations are no noise: the leader has changed its speed, and the pose is believed. */
#define SURPRISE 6.0
/* m/s: a slower leader stands; and 1/s: so much more for each metre of noise, because its speed is then less sure. */
#define STANDING 0.02
#define PER_NOISE 8.0
/* Metres of the trail that are kept at most; and how many poses: no more come 1 cm apart on what is not drawn yet. */
#define LONGEST 500.0
#define MOST_SAMPLES 127

/* The pose at `place` between the first `count` samples on either side; the first or the last one beyond them. */
static void between(const trail *t, int64_t count, double place, double *pose)
{
    int64_t after = 0;
    while (after < count && t->samples[after][0] <= place)
        after++;
    const double *a = t->samples[after > 0 ? after - 1 : 0], *b = t->samples[after < count ? after : count - 1];
    double share = b[0] > a[0] ? (place - a[0]) / (b[0] - a[0]) : 0.0, turn = b[3] - a[3];
    pose[0] = a[1] + share * (b[1] - a[1]);
    pose[1] = a[2] + share * (b[2] - a[2]);
    pose[2] = a[3] + share * (turn - TAU * rint(turn / TAU));
}

/* The point at `place` of the least-squares parabola of all samples within `reach`; with too few, as `between`. */
static void fit(const trail *t, double place, double reach, double *point)
{
    double s0 = 0, s1 = 0, s2 = 0, s3 = 0, s4 = 0, x0 = 0, x1 = 0, x2 = 0, y0 = 0, y1 = 0, y2 = 0;
    for (int64_t i = 0; i < t->count; i++) {
        double u = (t->samples[i][0] - place) / reach, v = u * u, x = t->samples[i][1], y = t->samples[i][2];
        if (v > 1.0)
            continue;
        s0 += 1.0, s1 += u, s2 += v, s3 += u * v, s4 += v * v;
        x0 += x, x1 += u * x, x2 += v * x;
        y0 += y, y1 += u * y, y2 += v * y;
    }
    /* The constant term of the parabola, by Cramer's rule on the normal equations. */
    double a = s2 * s4 - s3 * s3, b = s2 * s3 - s1 * s4, c = s1 * s3 - s2 * s2, det = s0 * a + s1 * b + s2 * c;
    if (s0 < 4.0 || det < 1e-3) {
        between(t, t->count, place, point);
    } else {
        point[0] = (x0 * a + x1 * b + x2 * c) / det;
        point[1] = (y0 * a + y1 * b + y2 * c) / det;
    }
}

static void keep_sample(trail *t, double place)
{
    double *sample = t->samples[t->count++];
    sample[0] = place;
    memcpy(sample + 1, t->leader, sizeof t->leader);
}

static void forget_sample(trail *t)
{
    memmove(t->samples[0], t->samples[1], --t->count * sizeof t->samples[0]);
}

void begin_trail(trail *t)
{
    t->place = t->path->end;
    t->speed = 0.0;
    t->has_turned = t->count = 0;
    t->noise = t->noise > 0.0 ? t->noise : 0.005;
    keep_sample(t, t->place);
}

/* The place of the newest pose. Cuts the trail if the leader has backed up behind its end. */
static double measure(trail *t)
{
    polyline *path = t->path;
    const double *last = row(path, path->count - 1);
    double x = t->leader[0] - last[0], y = t->leader[1] - last[1], away = length(x, y);
    if (t->has_turned)
        return path->end + away;
    double tip[3], found[2] = {path->end, 0.0}, cosine, sine, across;
    find_pose(path, path->end, tip);
    /* The direction of a single point is the leader's. */
    if (path->count < 2)
        tip[2] = t->leader[2];
    cosine_sine(tip[2], &cosine, &sine);
    double ahead = cosine * x + sine * y;
    if (ahead <= -REVERSE)
        find_nearest(path, t->leader[0], t->leader[1], path->end - JUMP, path->end, found);
    cosine_sine(t->leader[2] - tip[2], &cosine, &across);
    if (found[1] > BESIDE || cosine < 0.0) {
        /* It has turned round, or backs up another way: the trail goes on from here. */
        append_point(path, t->leader[0], t->leader[1]);
        t->count = 0, t->has_turned = 1;
        keep_sample(t, path->end);
        return path->end;
    }
    if (ahead > -REVERSE)
        return path->end + (ahead >= 0.0 ? away : ahead);
    cut_after(path, found[0]);
    t->count = 0;
    return path->end;
}

static void estimate(trail *t, double measured, double seconds)
{
    double expected = t->place + t->speed * seconds, error = measured - expected, most = SURPRISE * t->noise;
    int is_surprise = fabs(error) > most;
    t->place = expected + (is_surprise ? 1.0 : PLACE_GAIN) * error;
    t->speed += (is_surprise ? 1.0 : SPEED_GAIN) * error / seconds;
    t->noise += NOISE_GAIN * ((is_surprise ? most : fabs(error)) - t->noise);
    t->noise = t->noise > LEAST_NOISE ? t->noise : LEAST_NOISE;
}

/* Add the points of the trail that the leader is far enough ahead of. */
static void grow(trail *t)
{
    polyline *path = t->path;
    while (t->count && t->samples[t->count - 1][0] > t->place + REVERSE)
        t->count--;
    if (t->count == MOST_SAMPLES)
        forget_sample(t);
    if (!t->count || t->place >= t->samples[t->count - 1][0] + STEP)
        keep_sample(t, t->place);
    double reach = REACH + 10.0 * (t->noise - LEAST_NOISE);
    reach = reach < MOST_REACH ? reach : MOST_REACH;
    while (t->place >= path->end + SPACING + reach) {
        double before = path->end, place = before + SPACING, point[3];
        while (t->count > 1 && t->samples[1][0] < place - MOST_REACH)
            forget_sample(t);
        fit(t, place, reach, point);
        append_point(path, point[0], point[1]);
        t->has_turned = 0;
        if (path->end == before)
            break;
    }
}

int extend_trail(trail *t, double x, double y, double yaw, double seconds, double keep)
{
    if (!t->path->count || length(x - t->leader[0], y - t->leader[1]) > JUMP)
        return -1;
    if (!isfinite(x) || !isfinite(y) || !isfinite(yaw) || !(seconds > 0.0))
        return 0;
    t->leader[0] = x, t->leader[1] = y, t->leader[2] = yaw;
    estimate(t, measure(t), seconds);
    grow(t);
    keep = keep < LONGEST ? keep : LONGEST;
    if (t->place - t->path->start > keep + 1.0) {
        find_trail_pose(t, t->place - keep, 0.0, t->first);
        drop_before(t->path, t->place - keep);
    }
    return 1;
}

static int stands(const trail *t)
{
    return fabs(t->speed) < STANDING + PER_NOISE * (t->noise - LEAST_NOISE);
}

/* Of the speed at which the robot ahead drives away, by each new pose: noise of a pose is no way. */
#define SMOOTHING 0.25
/* m/s below which a robot does not come past to its place; and what is slower stands, and says why. */
#define SLOW 0.1
#define CREEP 0.01
/* Metres from base to base within which a robot does not drive on towards its neighbour: both can still turn. */
#define NEAREST 0.6
/* 1/s: speed besides that of the leader, by the error of the distance to it; by the room to the robot ahead. */
#define GAIN 1.0
#define NEAR_GAIN 1.5
/* Metres to its place behind a standing leader at which a robot stops, and at which it goes on. */
#define PARKED 0.03
#define LEFT 0.1
/* Metres of the trail: a robot that is no further behind, no further ahead, and no further beside it comes past to its
   place, and is waited for. */
#define BEHIND 5.0
#define PAST 0.3
#define OUT 1.0

int follow_trail(trail *t, const double *own, double place, double back, double x, double y, double apart,
                 int64_t stamp, int64_t leader_stamp, int64_t now, double *found)
{
    double off_x = x - own[0], off_y = y - own[1], seconds = (stamp - t->ahead_stamp) / 1e9, cosine, sine, there[2];
    if (seconds > 0.0) {
        double moved_x = x - t->ahead[0], moved_y = y - t->ahead[1], moved = off_x * moved_x + off_y * moved_y;
        t->leaves = seconds < 1.0 ? moved / (apart > NEAREST ? apart : NEAREST) / seconds : 0.0;
        t->steadily += SMOOTHING * (t->leaves - t->steadily);
        t->moves = length(moved_x, moved_y) > SLOW * seconds;
        t->ahead[0] = x, t->ahead[1] = y, t->ahead_stamp = stamp;
    }
    double late = stamp && now > stamp ? (now - stamp) / 1e9 : 0.0;
    double driven_on = t->steadily > 0.0 ? t->steadily * late : 0.0;
    late = leader_stamp && now > leader_stamp ? (now - leader_stamp) / 1e9 : 0.0;
    double error = t->place + t->speed * late - back - place;
    t->is_parked = error < (t->is_parked ? LEFT : PARKED) && stands(t);
    double speed = t->is_parked ? 0.0 : t->speed + GAIN * error;
    cosine_sine(own[2], &cosine, &sine);
    if (cosine * off_x + sine * off_y > 0.0) {
        double most = t->leaves + NEAR_GAIN * (apart + driven_on - NEAREST);
        speed = speed < most ? speed : most;
    }
    found[0] = speed >= CREEP ? speed : 0.0, found[1] = error, found[2] = driven_on;
    return t->moves && find_nearest(t->path, x, y, place - BEHIND, place + BEHIND, there) && there[0] < place + PAST
        && there[1] < OUT;
}

void find_trail_pose(trail *t, double place, double lateral, double *pose)
{
    const polyline *path = t->path;
    double along = 0.0, behind[3], ahead[3], cosine, sine;
    place = isnan(place) ? path->start : place;
    if (place >= t->place) {
        memcpy(pose, t->leader, sizeof t->leader);
        along = place - t->place;
    } else if (place <= path->start) {
        memcpy(pose, t->first, sizeof t->first);
        along = place - path->start;
    } else if (place > path->end - CHORD) {
        keep_sample(t, t->place);
        between(t, t->count--, place, pose);
    } else {
        find_pose(path, place, pose);
        find_pose(path, place - CHORD, behind);
        find_pose(path, place + CHORD, ahead);
        pose[2] = angle_of(ahead[0] - behind[0], ahead[1] - behind[1]);
    }
    cosine_sine(pose[2], &cosine, &sine);
    pose[0] += cosine * along - sine * lateral;
    pose[1] += sine * along + cosine * lateral;
}

double trail_curvature(trail *t, double place)
{
    double high = place + CHORD < t->place ? place + CHORD : t->place, low = place - CHORD, begin[3], end[3];
    low = low < high - CHORD ? low : high - CHORD;
    find_trail_pose(t, low, 0.0, begin);
    find_trail_pose(t, high, 0.0, end);
    double turn = end[2] - begin[2];
    return (turn - TAU * rint(turn / TAU)) / (high - low);
}
