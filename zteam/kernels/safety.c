/* The safety layer: what is left of a velocity that a driver wants, and what it goes by. zteam.robot.safety.layer has
   the rules. Points and arcs are metres, metres a second and radians in the frame of the base. */
#include <string.h>
#include "kernels.h"
#include "outlines.h"
#include "sines.h"

#define DEGREES (PI / 180.0)
#define SECOND 1000000000LL

/* Metres that stay free around a base that turns on the spot: less than what `wander` squeezes through; and beside one
   that drives: what the odometry and the laser are wrong by. */
#define SPIN_MARGIN 0.01
#define DRIVE_MARGIN 0.025
/* m/s of the fastest corner: what has to be slower than this stands, so that nothing crawls at the edge. */
#define SLOWEST 0.02
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

/* m/s and rad/s: no base moves so slowly, and a way divided by less would be no number. */
#define LEAST 1e-6
/* m/s² and rad/s²: how hard a base without limits is made to stop when data is old or a leader is gone: an erratic
   stands within 0.4 s, and so within 0.5 s of the loss. */
#define STOPPING 2.5
#define TURN_STOPPING 8.0
/* m/s and rad/s more than commanded that odometry may say for nothing. */
#define FASTER 0.02

/* Nanoseconds after which the word of a beam, or a pose that explains its silence, is too old. */
#define STALE (SECOND / 2)
/* Radians to either side of a teammate whose pose is fresh within which beams that say nothing are explained: its laser
   dazzles, by 2 degrees in the simulator. */
#define DAZZLE (5.0 * DEGREES)
/* Of bearings: a beam that speaks does so for the others of its sector. */
#define SECTORS 360
/* Radians to either side of its way that a laser has to see for a drive forwards. */
#define NARROW (15.0 * DEGREES)
/* Places on an arc at which is looked whether beams towards it say something. */
#define LOOKS 6

/* Metres that two robots stop apart, outline to outline; and to one that drives away, by more than so many m/s: a chain
   at 0.8 m from base to base has 0.45 m between two erratics. */
#define TEAMMATE_GAP 0.3
#define FOLLOWING_GAP 0.1
#define RECEDES 0.05
/* Seconds that a pose may be old for nothing: transforms come over the aggregator. Then the outline grows by so many
   m/s, or its own speed if that is more, up to so many metres. */
#define GRACE 0.3
#define GROWTH 0.25
#define MAX_GROWTH 0.5
/* Metres beside a teammate within which a hit is on that one. */
#define BODY 0.1
/* Seconds after which a pose says nothing any more: the robot was taken away, or its transforms never come. */
#define FORGET_AFTER 5.0
/* Metres between two outlines of a teammate on its way, at most, and how many there are at most. */
#define APART 0.2
#define MOST_OUTLINES 1000.0

/* Metres of travel that are remembered: longer, and the odometry's error outgrows the margins. */
#define SPAN 3.0
/* Metres: points further from the laser are not remembered. More than SPAN and a braking distance. */
#define REACH 4.0
/* Metres beyond its braking way that a base sees what stands around. */
#define BEYOND 0.5
/* Of beams so close together the nearest hit is a point: 5 mm apart where the corners of an erratic turn. */
#define FINEST (1.0 * DEGREES)
/* Metres that a base may back up where it was put down and still has room to turn. */
#define PUT 0.02
/* Metres of way behind it that a base no longer knows when it has turned by a radian. */
#define WEARS 0.5

/* Metres that a robot stops before what it would drive into. */
#define GAP 0.15
/* Metres more than the gap that have to be free before a robot that was stopped drives the same way again. */
#define HYSTERESIS 0.05
/* Seconds until the next command, at least, whatever the last step took; and seconds until the next command (no tick is
   known yet) that the first step is safe for, and reckons with. */
#define SHORTEST 0.05
#define FIRST 2.0
#define FIRST_TICK 0.1
/* m/s of the fastest corner, at most, where no laser looks: what was never seen is met so. */
#define UNSEEN_SPEED 0.2

enum { FREE, NO_NUMBER, BLIND, UNSEEN, STOPPED };
enum { AHEAD, BEHIND, BESIDE };

typedef struct {
    double x, y, turn;
} velocity;

static const velocity STANDING = {0.0, 0.0, 0.0};

static double larger(double a, double b)
{
    return a > b ? a : b;
}

static double smaller(double a, double b)
{
    return a < b ? a : b;
}

static double within(double value, double low, double high)
{
    return larger(low, smaller(high, value));
}

static double length(double x, double y)
{
    return y != 0.0 ? sqrt(x * x + y * y) : fabs(x);
}

/* In [-pi, pi]. */
static double wrap(double angle)
{
    return angle - TAU * rint(angle / TAU);
}

static double speed_of(velocity v)
{
    return length(v.x, v.y);
}

static int is_standing(velocity v)
{
    return v.x == 0.0 && v.y == 0.0 && v.turn == 0.0;
}

static int are_equal(velocity a, velocity b)
{
    return a.x == b.x && a.y == b.y && a.turn == b.turn;
}

/* The same arc, driven at a share of its speed. */
static velocity scale(velocity v, double share)
{
    return (velocity){v.x * share, v.y * share, v.turn * share};
}

/* Where a pose's point is in the frame that the pose is told in. */
static void place(double x, double y, double cosine, double sine, double along, double aside, double *at)
{
    at[0] = x + cosine * along - sine * aside;
    at[1] = y + sine * along + cosine * aside;
}

/* Where a base is after so long, in its frame of now. */
static void move_on(velocity v, double seconds, double *at, double *cosine, double *sine)
{
    double angle = v.turn * seconds, ahead = seconds, aside = 0.0;
    cosine_sine(angle, cosine, sine);
    if (fabs(angle) >= STRAIGHT) {
        ahead = *sine / v.turn;
        aside = (1.0 - *cosine) / v.turn;
    }
    at[0] = v.x * ahead - v.y * aside;
    at[1] = v.x * aside + v.y * ahead;
}

/* Limits of a base */

static velocity clamp(const base_limits *b, velocity v)
{
    v.x = within(fabs(v.x) >= LEAST ? v.x : 0.0, b->low, b->high);
    v.y = within(fabs(v.y) >= LEAST ? v.y : 0.0, -b->aside, b->aside);
    v.turn = within(fabs(v.turn) >= LEAST ? v.turn : 0.0, -b->turn, b->turn);
    return v;
}

int motion_of(const base_limits *b, const double *wanted, double *motion)
{
    velocity v = {wanted[0], b->aside > 0.0 ? wanted[1] : 0.0, wanted[2]};
    if (!(fabs(v.x) < INFINITY && fabs(v.y) < INFINITY && fabs(v.turn) < INFINITY))
        return 0;
    if (b->is_car) {
        double cosine, sine;
        cosine_sine(v.turn, &cosine, &sine);
        v.x = within(v.x, b->low, b->high);
        v = (velocity){v.x * cosine, 0.0, v.x * sine / b->wheelbase};
    }
    v = clamp(b, v);
    memcpy(motion, &v, sizeof v);
    return 1;
}

void command_of(const base_limits *b, const double *motion, double *command)
{
    memcpy(command, motion, 3 * sizeof *command);
    if (b->is_car) {
        double x = motion[0], turn = motion[2];
        command[0] = copysign(length(x, turn * b->wheelbase), x) * (x != 0.0);
        command[2] = x != 0.0 ? angle_of(fabs(x), copysign(turn, turn * x) * b->wheelbase) : 0.0;
    }
}

double stop_time(const base_limits *b, const double *motion)
{
    double x = motion[0], straight = larger(fabs(x) / b->braking[x < 0.0], fabs(motion[1]) / b->aside_braking);
    return b->is_car ? straight : larger(straight, fabs(motion[2]) / b->turn_braking);
}

static double time_to_stop(const base_limits *b, velocity v)
{
    return stop_time(b, &v.x);
}

/* `wanted`, but at most `gain` faster and `loss` slower than `last`; turning round means losing speed first. */
static double approach_part(double wanted, double last, double gain, double loss)
{
    if (wanted * last < 0.0) {
        double left = fabs(last) - loss;
        return left > 0.0 ? copysign(left, last) : copysign(smaller(fabs(wanted), gain), wanted);
    }
    double size = smaller(larger(fabs(wanted), fabs(last) - loss), fabs(last) + gain);
    return copysign(size, wanted == 0.0 ? last : wanted);
}

/* What comes of `wanted` in `seconds` within the limits of acceleration, if the base has any. */
static velocity approach(const base_limits *b, velocity wanted, velocity last, double seconds)
{
    if (!b->accelerates)
        return wanted;
    velocity v;
    double spin = b->spin * seconds, swerve = b->swerve * seconds;
    v.x = approach_part(wanted.x, last.x, b->gain[wanted.x < 0.0] * seconds, b->loss[last.x < 0.0] * seconds);
    v.y = approach_part(wanted.y, last.y, swerve, swerve);
    /* The wheels of a car that slows down take its turn with them. */
    v.turn = approach_part(wanted.turn, last.turn, spin, b->is_car ? INFINITY : spin);
    if (b->is_car && (v.x != wanted.x || wanted.turn * last.turn < 0.0)) {
        /* They go through straight on, and are never turned more sharply than was asked for. */
        double sharpest = wanted.x != 0.0 && wanted.turn * last.turn >= 0.0 ? fabs(wanted.turn * v.x / wanted.x) : 0.0;
        v.turn = within(v.turn, -sharpest, sharpest);
    }
    return v;
}

/* The motion after braking for `seconds`: along the same arc, as hard as all parts can. */
static velocity brake(const base_limits *b, velocity last, double seconds)
{
    double straight = speed_of(last) / STOPPING, turning = fabs(last.turn) / TURN_STOPPING;
    double longest = b->accelerates ? time_to_stop(b, last) : b->is_car ? straight : larger(straight, turning);
    return longest > seconds ? scale(last, 1.0 - seconds / longest) : STANDING;
}

/* Meeting a point */

/* Points (2, n), placed at a pose. */
typedef struct {
    const double *x, *y;
    int64_t count;
    double at[2], cosine, sine;
} cloud;

/* An arc that is looked at, and what holds all that the base sweeps on it with the margin: a disc, and a ring about the
   centre of the arc, or a strip along it. */
typedef struct {
    const base_limits *base;
    velocity motion;
    int is_straight;
    double seconds, margin, reach, at[2], radius, centre[2], inner, outer;
} sweep;

/* How far a point is from the centre of the arc, or to the left of a straight one. */
static double aside_of(const sweep *s, double x, double y)
{
    if (s->is_straight)
        return s->motion.x * y - s->motion.y * x;
    return sqrt((x - s->centre[0]) * (x - s->centre[0]) + (y - s->centre[1]) * (y - s->centre[1]));
}

static sweep sweep_of(const base_limits *b, velocity v, double seconds, double clearance)
{
    double speed = speed_of(v), fastest = speed + fabs(v.turn) * b->radius, cosine, sine;
    sweep s = {.base = b, .motion = v, .seconds = seconds, .margin = SPIN_MARGIN + clearance};
    s.margin += (DRIVE_MARGIN - SPIN_MARGIN) * (fastest > 0.0 ? speed / fastest : 0.0);
    move_on(v, 0.5 * seconds, s.at, &cosine, &sine);
    s.radius = 0.5 * speed * seconds + b->radius + s.margin;
    s.is_straight = fabs(v.turn * seconds) < STRAIGHT;
    s.centre[0] = -v.y / v.turn;
    s.centre[1] = v.x / v.turn;
    s.inner = INFINITY;
    s.outer = -INFINITY;
    for (int64_t i = 0; i < b->tips; i++) {
        double aside = aside_of(&s, b->corners[2 * i], b->corners[2 * i + 1]);
        s.inner = smaller(s.inner, aside);
        s.outer = larger(s.outer, aside);
    }
    if (!s.is_straight)
        s.inner = depth_of(s.centre[0], s.centre[1], b->planes, b->sides);
    /* Half-planes are at most a right angle apart: at a corner they are moved by the margin so much further. */
    s.reach = 1.42 * s.margin + TINY;
    s.inner -= s.reach * (s.is_straight ? speed : 1.0);
    s.outer += s.reach * (s.is_straight ? speed : 1.0);
    return s;
}

/* Seconds until a base that drives straight on has a point within `limit` of all half-planes at once. */
static double meet_straight(double x, double y, double limit, const base_limits *b, velocity v)
{
    double enters = 0.0, leaves = INFINITY;
    for (const double *plane = b->planes; plane < b->planes + 3 * b->sides; plane += 3) {
        /* Adding 0 makes 0 of -0, which would turn infinities round. */
        double closing = v.x * plane[0] + v.y * plane[1] + 0.0;
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
static double meet_turning(double x, double y, double limit, const base_limits *b, const double *centre, double side)
{
    double centre_x = centre[0], centre_y = centre[1], u = x - centre_x, v = y - centre_y, square = u * u + v * v, away = sqrt(square), met = INFINITY;
    if (!(away > TINY))
        return met;
    for (const double *plane = b->planes; plane < b->planes + 3 * b->sides; plane += 3) {
        /* Seen from the base, the point goes round the centre: a cos + b sin of the angle is how far towards the plane.
           Where that is `reach`, and becomes less, the point comes in: at the solution of a quadratic equation. */
        double a = plane[0] * u + plane[1] * v, c = side * (plane[0] * v - plane[1] * u);
        double reach = plane[2] - plane[0] * centre_x - plane[1] * centre_y + limit;
        reach = reach > away ? away : reach < -away ? -away : reach;
        double root = sqrt((away - reach) * (away + reach));
        double cosine = (a * reach - c * root) / square, sine = (c * reach + a * root) / square;
        double there_x = centre_x + cosine * u + side * sine * v, there_y = centre_y + cosine * v - side * sine * u;
        if (depth_of(there_x, there_y, b->planes, b->sides) <= limit + TINY) {
            double turned = angle_of(cosine, sine);
            turned = turned < 0.0 ? turned + TAU : turned;
            met = turned < met ? turned : met;
        }
    }
    return met;
}

/* Of the points in the disc: how near the nearest one is that is not all but touched, and when (s) the first is met. */
static int is_within(const cloud *points, int64_t i, const sweep *s, double *at)
{
    place(points->at[0], points->at[1], points->cosine, points->sine, points->x[i], points->y[i], at);
    double x = at[0] - s->at[0], y = at[1] - s->at[1];
    return x * x + y * y <= s->radius * s->radius;
}

static double nearest_of(const cloud *points, const sweep *s, double nearest)
{
    const double near = s->base->radius + s->reach;
    double at[2];
    for (int64_t i = 0; i < points->count; i++)
        if (is_within(points, i, s, at) && at[0] * at[0] + at[1] * at[1] <= near * near) {
            double depth = depth_of(at[0], at[1], s->base->planes, s->base->sides);
            nearest = CLOSEST < depth && depth < nearest ? depth : nearest;
        }
    return nearest;
}

static double first_of(const cloud *points, const sweep *s, double nearest, double first)
{
    const velocity v = s->motion;
    /* It may move along a wall that is nearer than the margin now: other points of that come as near. */
    const double margin = smaller(s->margin, nearest);
    double at[2];
    for (int64_t i = 0; i < points->count; i++) {
        if (!is_within(points, i, s, at))
            continue;
        double aside = aside_of(s, at[0], at[1]);
        if (aside < s->inner || aside > s->outer)
            continue;
        double depth = depth_of(at[0], at[1], s->base->planes, s->base->sides);
        /* Where it is nearer than the margin now, it may come a little nearer. */
        double limit = depth - ROUNDING < CLOSEST ? depth - ROUNDING : CLOSEST;
        limit = depth - TOUCH > limit ? depth - TOUCH : limit;
        limit = margin < limit ? margin : limit;
        double met = s->is_straight ? meet_straight(at[0], at[1], limit, s->base, v)
            : meet_turning(at[0], at[1], limit, s->base, s->centre, v.turn < 0.0 ? -1.0 : 1.0) / fabs(v.turn);
        first = met < first ? met : first;
    }
    return first;
}

/* Seconds until the base comes nearer to a point of `count` copies of a cloud than the margin; inf: it does not. Each
   copy is further on by a step. Where it is nearer than that now, what counts is when it comes nearer still to that
   point, or as near to another: so it may always move away, and along a wall. */
static double meet_copies(const sweep *s, const cloud *points, double count, double step_x, double step_y)
{
    double nearest = INFINITY, first = INFINITY;
    cloud copy = *points;
    for (double i = 0.0; i < count; i++) {
        copy.at[0] = points->at[0] + i * step_x;
        copy.at[1] = points->at[1] + i * step_y;
        nearest = nearest_of(&copy, s, nearest);
    }
    for (double i = 0.0; i < count; i++) {
        copy.at[0] = points->at[0] + i * step_x;
        copy.at[1] = points->at[1] + i * step_y;
        first = first_of(&copy, s, nearest, first);
    }
    return first <= s->seconds ? first : INFINITY;
}

static cloud cloud_of(const double *x, const double *y, int64_t count)
{
    return (cloud){.x = x, .y = y, .count = count, .cosine = 1.0};
}

double meet(const base_limits *b, const double *motion, double seconds, double clearance, const double *points,
            int64_t count)
{
    sweep s = sweep_of(b, (velocity){motion[0], motion[1], motion[2]}, seconds, clearance);
    cloud all = cloud_of(points, points + count, count);
    return meet_copies(&s, &all, 1.0, 0.0, 0.0);
}

/* The share of its speed at which a base may drive that has `free` seconds at its full speed, of the fastest corner. */
static double share_of(double free, double braking, double reaction, double fastest)
{
    if (free <= 0.0)
        return 0.0;
    if (free >= reaction + 0.5 * braking)
        return 1.0;
    double share = (sqrt(reaction * reaction + 2.0 * braking * free) - reaction) / braking;
    return share * fastest >= SLOWEST ? share : 0.0;
}

/* What is to be free of an arc: the base stops `gap` metres before a point, as far as it drives and not turns. */
typedef struct {
    velocity motion;
    double braking, fastest, kept, seconds;
} braking_arc;

static braking_arc arc_of(const safety_memory *m, velocity v, double gap)
{
    braking_arc arc = {.motion = v, .braking = time_to_stop(m->base, v)};
    arc.fastest = speed_of(v) + fabs(v.turn) * m->base->radius;
    arc.kept = speed_of(v) / (arc.fastest * arc.fastest) * gap + m->extra / arc.fastest;
    arc.seconds = m->reaction + 0.5 * arc.braking + arc.kept;
    return arc;
}

/* The share of its speed at which it can stop before all these points. */
static double admissible(const safety_memory *m, velocity v, double gap, double clearance, const cloud *points,
                         double count, double step_x, double step_y)
{
    braking_arc arc = arc_of(m, v, gap);
    sweep s = sweep_of(m->base, v, arc.seconds, clearance);
    double free = meet_copies(&s, points, count, step_x, step_y);
    return share_of(free - arc.kept, arc.braking, m->reaction, arc.fastest);
}

/* Teammates */

/* Take where the teammates are now. */
static void look_at_mates(safety_memory *m, const safety_inputs *in)
{
    const double *here = in->own_row < 0 ? NULL : in->poses + 3 * in->own_row;
    m->is_here = here && fabs(here[0] + here[1] + here[2]) < INFINITY;
    if (m->is_here) {
        m->here_x = here[0];
        m->here_y = here[1];
        m->here_yaw = here[2];
    }
    for (teammate *t = m->mates; t < m->mates + m->mate_count; t++) {
        const double *pose = in->poses + 3 * t->row;
        int64_t stamp = in->stamps[t->row], ahead = stamp - in->now;
        double age = stamp ? -1e-9 * (double)ahead : 0.0, seconds = 1e-9 * (double)(stamp - t->stamp);
        int was_known = t->is_known;
        t->is_known = fabs(pose[0] + pose[1] + pose[2]) < INFINITY && age <= FORGET_AFTER;
        t->is_fresh = t->is_known && m->is_here && (!stamp || (ahead <= STALE && ahead >= -STALE));
        if (!t->is_known)
            continue;
        if (!was_known || seconds < 0.0 || !stamp)
            t->speed_x = t->speed_y = t->speed = 0.0;
        else if (seconds > 0.0) {
            t->speed_x = (pose[0] - t->x) / seconds;
            t->speed_y = (pose[1] - t->y) / seconds;
            t->speed = sqrt(t->speed_x * t->speed_x + t->speed_y * t->speed_y);
            if (t->speed > t->base->too_fast)
                t->speed_x = t->speed_y = t->speed = 0.0;
        }
        t->x = pose[0];
        t->y = pose[1];
        t->yaw = pose[2];
        t->stamp = stamp;
        t->age = larger(0.0, age);
    }
}

/* Where a teammate is in the base frame. */
static void find_mate(const safety_memory *m, const teammate *t, double *at)
{
    double cosine, sine;
    cosine_sine(-m->here_yaw, &cosine, &sine);
    place(0.0, 0.0, cosine, sine, t->x - m->here_x, t->y - m->here_y, at);
}

/* The share of its speed at which the base can stop before a teammate, on all its way until it stands; above 1: it is
   not in the way at all. */
static double share_before(const safety_memory *m, const teammate *t, velocity v)
{
    double way = t->speed * (t->age + m->reaction + 0.5 * t->speed / t->base->least_braking), cosine, sine;
    double growth = t->age <= GRACE ? 0.0 : smaller(MAX_GROWTH, (t->age - GRACE) * larger(t->speed, GROWTH));
    sweep s = sweep_of(m->base, v, arc_of(m, v, 0.0).seconds + TEAMMATE_GAP / arc_of(m, v, 0.0).fastest, 0.0);
    cloud border = cloud_of(t->base->border, t->base->border + t->base->edge, t->base->edge);
    find_mate(m, t, border.at);
    double away = length(border.at[0] - s.at[0], border.at[1] - s.at[1]) - t->base->radius;
    if (away > s.radius + way + growth)
        return 2.0;
    cosine_sine(t->yaw - m->here_yaw, &border.cosine, &border.sine);
    cosine_sine(-m->here_yaw, &cosine, &sine);
    double vx = cosine * t->speed_x - sine * t->speed_y, vy = sine * t->speed_x + cosine * t->speed_y;
    if (vx * border.at[0] + vy * border.at[1] > RECEDES * length(border.at[0], border.at[1]))
        /* It comes no nearer, should it stop at once. */
        return admissible(m, v, FOLLOWING_GAP, growth, &border, 1.0, 0.0, 0.0);
    /* Beyond the disc it is not in the way any more. */
    way = smaller(way, away + 2.0 * (s.radius + t->base->radius));
    double count = smaller(ceil(way / APART), MOST_OUTLINES), step = count > 0.0 ? way / count / t->speed : 0.0;
    return admissible(m, v, TEAMMATE_GAP, growth, &border, count + 1.0, vx * step, vy * step);
}

/* What stands around */

/* The robot is somewhere else. */
static void forget(safety_memory *m)
{
    m->count = m->silent_count = m->has_beams = 0;
    m->travelled = m->backing = m->middle = m->half = 0.0;
    m->range = INFINITY;
    m->whole = INT64_MIN / 2;
    for (int i = 0; i < SECTORS; i++)
        m->heard[i] = INT64_MIN / 2;
}

/* Tell the points in the frame of the base after it has moved to this pose of its frame. */
static void move_points(safety_memory *m, double x, double y, double turn)
{
    double cosine, sine, *known_x = m->known, *known_y = m->known + m->room;
    cosine_sine(turn, &cosine, &sine);
    for (int64_t i = 0; i < m->count; i++) {
        double ahead = known_x[i] - x, aside = known_y[i] - y;
        known_x[i] = cosine * ahead + sine * aside;
        known_y[i] = cosine * aside - sine * ahead;
    }
}

/* The base is where odometry says. */
static void move(safety_memory *m, const double *odom, double reach)
{
    if (odom && !(fabs(odom[0] + odom[1] + odom[2]) < INFINITY))
        return;
    double dx = odom ? odom[0] - m->x : 0.0, dy = odom ? odom[1] - m->y : 0.0, way = sqrt(dx * dx + dy * dy);
    if (!m->has_pose || !odom || way > reach) {
        /* It was set down here, or it is not known where the points are now. */
        forget(m);
        m->has_pose = odom != NULL;
        m->yaw = 0.0;
    } else if (dx != 0.0 || dy != 0.0 || odom[2] != m->yaw) {
        double cosine, sine, at[2], turn = wrap(odom[2] - m->yaw), worn;
        cosine_sine(-m->yaw, &cosine, &sine);
        place(0.0, 0.0, cosine, sine, dx, dy, at);
        m->travelled += way;
        move_points(m, at[0], at[1], turn);
        cosine_sine(0.5 * turn, &cosine, &sine);
        m->backing = cosine * at[0] + sine * at[1] > 0.9 * way ? smaller(SPAN, m->backing + way) : m->backing - way;
        worn = m->backing - WEARS * fabs(turn);
        m->backing = larger(smaller(0.0, m->backing), worn);
    }
    if (odom) {
        m->x = odom[0];
        m->y = odom[1];
        m->yaw = odom[2];
    }
}

int64_t see(double *known, int64_t count, int64_t room, const double *axes, const double *distances, int64_t beams,
            double start, double step, int64_t few, double x, double y, double far, double way, double oldest)
{
    const double stride = fabs(step) > 1e-6 ? step : step < 0.0 ? -1e-6 : 1e-6, circle = rint(TAU / fabs(stride));
    const double around = circle > 1.0 ? circle : 1.0;
    double *known_y = known + room, *seen_at = known + 2 * room;
    int64_t kept = 0;
    for (int64_t i = 0; i < count; i++) {
        double dx = known[i] - x, dy = known_y[i] - y, away = sqrt(dx * dx + dy * dy);
        double beam = rint((angle_of(dx, dy) - start) / stride);
        beam -= around * floor(beam / around);
        int told = beam >= 0.0 && beam < beams && distances[(int64_t)beam] >= away - SEEN_WITHIN;
        if (!told && away <= far && seen_at[i] >= oldest) {
            known[kept] = known[i];
            known_y[kept] = known_y[i];
            seen_at[kept++] = seen_at[i];
        }
    }
    for (int64_t i = 0; i < beams && kept < room; i += few) {
        int64_t nearest = -1;
        double distance = far;
        for (int64_t j = i; j < beams && j - i < few; j++)
            if (distances[j] < distance)
                distance = distances[nearest = j];
        if (nearest >= 0) {
            known[kept] = x + distance * axes[nearest];
            known_y[kept] = y + distance * axes[beams + nearest];
            seen_at[kept++] = way;
        }
    }
    return kept;
}

static int sector_of(double bearing)
{
    double sector = bearing * (SECTORS / TAU);
    return (int)(sector - SECTORS * floor(sector / SECTORS)) % SECTORS;
}

/* Take a scan: what it shows, and which of its beams have been silent for a while. */
static void take_scan(safety_memory *m, const safety_inputs *in, double reach)
{
    m->range = in->range > 0.0 ? in->range : INFINITY;
    m->has_beams = in->beams > 0;
    if (!m->has_beams)
        return;
    m->laser_x = in->laser_x;
    m->laser_y = in->laser_y;
    m->silent_count = 0;
    m->middle = in->start + 0.5 * in->step * (double)(in->beams - 1);
    m->half = 0.5 * fabs(in->step) * (double)in->beams;
    if (in->all_speak)
        m->whole = in->now;
    else {
        /* The beams were then where they are now, or nearly so. */
        for (int64_t i = 0; i < in->beams && m->whole > 0; i++)
            m->heard[sector_of(in->angles[i] + m->yaw)] = m->whole;
        m->whole = smaller(m->whole, -1);
        for (int64_t i = 0; i < in->beams; i++)
            if (in->distances[i] == in->distances[i])
                m->heard[sector_of(in->angles[i] + m->yaw)] = in->now;
        for (int64_t i = 0; i < in->beams; i++)
            if (in->distances[i] != in->distances[i]
                && m->heard[sector_of(in->angles[i] + m->yaw)] < in->now - STALE)
                m->silent[m->silent_count++] = in->angles[i];
    }
    double few = FINEST / larger(fabs(in->step), 1e-9) + 1e-6;
    m->count = see(m->known, m->count, m->room, in->axes, in->distances, in->beams, in->start, in->step,
                   few > 1.0 ? (int64_t)few : 1, m->laser_x, m->laser_y, larger(REACH, reach), m->travelled,
                   m->travelled - SPAN);
}

/* Whether the laser looks to all bearings within `spare` (rad) of one. */
static int looks(const safety_memory *m, double bearing, double spare)
{
    return m->half > 3.1 || fabs(wrap(bearing - m->middle)) + spare <= m->half;
}

/* Whether the ground that the corners come to in a turn was seen, or the base was put down there. */
static int has_room(const safety_memory *m)
{
    return m->backing >= -PUT || looks(m, 0.0, PI);
}

/* Forget the points at teammates that the laser does not see wholly. Their poses say where they are, and hits on them
   would stay when they have driven on. */
static void forget_mates(safety_memory *m)
{
    for (const teammate *t = m->mates; m->is_here && t < m->mates + m->mate_count; t++) {
        double at[2], cosine, sine, radius = t->base->radius, *known_x = m->known, *known_y = m->known + m->room;
        if (!t->is_known || t->age > GRACE)
            continue;
        find_mate(m, t, at);
        double away = larger(length(at[0], at[1]), radius);
        if (!(away < REACH) || looks(m, angle_of(at[0], at[1]), radius / away))
            continue;
        cosine_sine(m->here_yaw - t->yaw, &cosine, &sine);
        int64_t kept = 0;
        for (int64_t i = 0; i < m->count; i++) {
            double there[2];
            place(0.0, 0.0, cosine, sine, known_x[i] - at[0], known_y[i] - at[1], there);
            if (depth_of(there[0], there[1], t->base->planes, t->base->sides) > BODY) {
                known_x[kept] = known_x[i];
                known_y[kept] = known_y[i];
                m->known[2 * m->room + kept++] = m->known[2 * m->room + i];
            }
        }
        m->count = kept;
    }
}

/* Whether the laser looks where the base drives to within `seconds`: a little to either side of a way forwards, and
   else as far as the base is wide. A turn on the spot is no way. */
static int looks_along(const safety_memory *m, velocity v, double seconds, int forwards)
{
    double way = angle_of(v.x, v.y), bend = within(0.5 * v.turn * seconds, -1.0, 1.0);
    return speed_of(v) == 0.0 || (forwards ? looks(m, way + bend, NARROW) : looks(m, way, 0.5 * PI));
}

static int is_explained(const safety_memory *m, double bearing)
{
    for (const teammate *t = m->mates; t < m->mates + m->mate_count; t++)
        if (t->is_fresh && fabs(wrap(bearing - t->bearing)) <= DAZZLE)
            return 1;
    return 0;
}

/* Call `take` with the bearing from the laser of every corner on the way that it looks to. */
typedef struct {
    double x, y, low, high, middle;
} span;

static void span_way(const safety_memory *m, velocity v, double seconds, span *s, int is_sum)
{
    const base_limits *b = m->base;
    for (int look = 1; look <= LOOKS; look++) {
        double at[2], corner[2], cosine, sine;
        move_on(v, seconds / LOOKS * look, at, &cosine, &sine);
        for (int64_t i = 0; i < b->tips; i++) {
            place(at[0], at[1], cosine, sine, b->corners[2 * i], b->corners[2 * i + 1], corner);
            double x = corner[0] - m->laser_x, y = corner[1] - m->laser_y, bearing = angle_of(x, y);
            if (!(depth_of(corner[0], corner[1], b->planes, b->sides) > 0.0)
                || fabs(wrap(bearing - m->middle)) > m->half)
                continue;
            if (is_sum) {
                s->x += x / length(x, y);
                s->y += y / length(x, y);
            } else {
                s->low = smaller(s->low, wrap(bearing - s->middle));
                s->high = larger(s->high, wrap(bearing - s->middle));
            }
        }
    }
}

/* Whether a beam that says nothing points into the way; those towards teammates are explained. */
static int is_blind(safety_memory *m, velocity v, double seconds)
{
    span way = {.low = INFINITY, .high = -INFINITY};
    for (teammate *t = m->mates; t < m->mates + m->mate_count; t++)
        if (t->is_fresh) {
            double at[2];
            find_mate(m, t, at);
            t->bearing = angle_of(at[0] - m->laser_x, at[1] - m->laser_y);
        }
    seconds = larger(seconds, 0.3 / speed_of(v));
    span_way(m, v, seconds, &way, 1);
    way.middle = angle_of(way.x, way.y);
    span_way(m, v, seconds, &way, 0);
    for (int64_t i = 0; i < m->silent_count; i++) {
        double off = wrap(m->silent[i] - way.middle);
        if (off >= way.low && off <= way.high && !is_explained(m, m->silent[i]))
            return 1;
    }
    return 0;
}

/* The rules */

static int64_t side_of(velocity v)
{
    return fabs(v.y) > fabs(v.x) || v.x == 0.0 ? BESIDE : v.x > 0.0 ? AHEAD : BEHIND;
}

/* Forwards or not, left or not; never 0. */
static int64_t way_of(velocity v)
{
    return 1 + 2 * (v.x > 0.0) + 4 * (v.x == 0.0 && (v.y != 0.0 ? v.y : v.turn) > 0.0);
}

/* A motion, with each part as large as it is measured where the base is faster than it was told to be. */
static velocity real_of(const safety_memory *m, velocity v)
{
    const double *most = m->measured;
    if (!m->is_faster)
        return v;
    return (velocity){
        v.x != 0.0 ? copysign(larger(fabs(v.x), fabs(most[0])), v.x) : v.x,
        v.y != 0.0 ? copysign(larger(fabs(v.y), fabs(most[1])), v.y) : v.y,
        v.turn != 0.0 ? copysign(larger(fabs(v.turn), fabs(most[2])), v.turn) : v.turn,
    };
}

/* Take the velocity that odometry says, if the base is faster than it was told to be in some part. */
static void measure(safety_memory *m, const double *odom)
{
    const double *told = m->motion;
    m->is_faster = 0;
    if (!odom)
        return;
    m->measured[0] = odom[3];
    m->measured[1] = m->base->aside > 0.0 ? odom[4] : 0.0;
    m->measured[2] = odom[5];
    for (int i = 0; i < 3; i++)
        m->is_faster |= fabs(m->measured[i]) > fabs(told[i]) + FASTER;
    m->is_faster &= fabs(m->measured[0] + m->measured[1] + m->measured[2]) < INFINITY;
}

/* The share of its speed at which a motion can stop before all; what it would meet first goes to `met`. */
static double share_of_motion(const safety_memory *m, velocity v, int64_t *met)
{
    cloud around = cloud_of(m->known, m->known + m->room, m->count);
    v = real_of(m, v);
    double least = admissible(m, v, GAP, 0.0, &around, 1.0, 0.0, 0.0);
    *met = -1;
    for (const teammate *t = m->mates; m->is_here && t < m->mates + m->mate_count; t++) {
        double share = t->is_known ? share_before(m, t, v) : 2.0;
        if (share < least || (share == least && least < 1.0 && *met < 0)) {
            least = share;
            *met = t->robot_id;
        }
    }
    return least;
}

/* As far as the ground that a motion leads over is seen. */
static velocity slow_down_unseen(safety_memory *m, velocity asked, int64_t *cause)
{
    velocity v = real_of(m, asked);
    if (is_standing(v))
        return asked;
    double braking = time_to_stop(m->base, v), seconds = m->reaction + 0.5 * braking, fastest = 0.0, share = 1.0;
    int forwards = v.x > 0.0 && fabs(v.y) <= 0.5 * v.x;
    if (m->has_beams ? speed_of(v) != 0.0 && m->silent_count && is_blind(m, v, seconds) : forwards) {
        *cause = BLIND;
        m->side = side_of(asked);
        return (velocity){.turn = asked.turn};
    }
    int is_seen = looks_along(m, v, seconds, forwards);
    if (is_seen && !(v.turn != 0.0 && !has_room(m))) {
        /* What is beyond its range no laser has seen. */
        if (forwards)
            share = share_of(m->range / speed_of(v), braking, m->reaction, speed_of(v));
    } else {
        for (int64_t i = 0; i < m->base->tips; i++) {
            const double *corner = m->base->corners + 2 * i;
            fastest = larger(fastest, length(v.x - v.turn * corner[1], v.y + v.turn * corner[0]));
        }
        share = UNSEEN_SPEED / fastest;
    }
    if (!(share < 1.0))
        return asked;
    *cause = UNSEEN;
    m->side = is_seen && !forwards ? BEHIND : side_of(asked);
    return scale(asked, share);
}

/* What is left of a motion: slower, but turning as was wanted where there is room; else straight on. */
static velocity avoid(safety_memory *m, velocity v, int64_t *cause)
{
    int64_t met, other;
    double share = is_standing(v) ? 1.0 : share_of_motion(m, v, &met);
    if (share >= 1.0)
        return v;
    velocity slow = scale(v, share);
    /* A car turns the less, the more slowly it drives. */
    if (v.turn != 0.0 && speed_of(v) != 0.0 && !m->base->is_car) {
        velocity turning = {slow.x, slow.y, v.turn}, straight = {v.x, v.y, 0.0};
        double free = share_of_motion(m, turning, &other);
        if (free >= 1.0 || share == 0.0)
            slow = scale(turning, free);
        /* The tail of a robot beside a wall has room to drive on, but not to turn. */
        if (is_standing(slow))
            slow = scale(straight, share_of_motion(m, straight, &other));
    }
    if (speed_of(slow) == 0.0 && (speed_of(v) != 0.0 || slow.turn == 0.0)) {
        *cause = STOPPED;
        m->met = met;
        m->side = side_of(v);
    }
    return slow;
}

/* A motion as far as nothing stands in its way. */
static velocity cut(safety_memory *m, velocity asked, const double *odom, int64_t *cause)
{
    if (is_standing(asked))
        return asked;
    m->extra = m->held == way_of(asked) ? HYSTERESIS : 0.0;
    measure(m, odom);
    velocity slow = slow_down_unseen(m, asked, cause), motion = avoid(m, slow, cause);
    if (!are_equal(motion, slow)) {
        /* It may lead over other ground. A turn on the spot that is left then was not looked at. */
        int64_t side = m->side, other = FREE, met = m->met;
        velocity seen = slow_down_unseen(m, motion, &other);
        if (*cause == FREE)
            *cause = other;
        else
            m->side = side;
        motion = speed_of(seen) != 0.0 || speed_of(motion) == 0.0 ? seen : avoid(m, seen, &other);
        m->met = met;
        m->side = side;
    }
    m->held = (speed_of(asked) != 0.0 && speed_of(motion) == 0.0) || is_standing(motion) ? way_of(asked) : 0;
    return motion;
}

int64_t limit(safety_memory *m, const safety_inputs *in, const double *wanted)
{
    const base_limits *b = m->base;
    velocity asked, motion, last = {m->motion[0], m->motion[1], m->motion[2]};
    double seconds = in->dt > 0.0 ? larger(in->dt, SHORTEST) : FIRST_TICK;
    int64_t cause = FREE;
    int is_number = motion_of(b, wanted, &asked.x);
    m->reaction = in->dt > 0.0 ? seconds : FIRST;
    if (!in->is_old) {
        double fastest = larger(larger(b->high, -b->low), b->aside);
        double reach = fastest * (m->reaction + 0.5 * fastest / b->least_braking) + b->radius + BEYOND;
        move(m, in->odom, reach);
        if (in->has_scan)
            take_scan(m, in, reach);
        look_at_mates(m, in);
        forget_mates(m);
    }
    if (in->is_old || !is_number || (in->lacks && is_standing(asked))) {
        motion = brake(b, last, seconds);
        cause = is_number ? FREE : NO_NUMBER;
    } else {
        asked = approach(b, asked, last, seconds);
        motion = cut(m, asked, in->odom, &cause);
        /* What lies between the two was not looked at. The way of the last command was: with even braking. */
        if (!are_equal(motion, approach(b, motion, last, seconds)))
            motion = brake(b, last, seconds);
    }
    memcpy(m->motion, &motion, sizeof motion);
    command_of(b, m->motion, m->command);
    return cause;
}

void see_poses(const double *poses, int64_t count, int64_t own, double *seen)
{
    double cosine, sine, x = poses[3 * own], y = poses[3 * own + 1], yaw = poses[3 * own + 2];
    cosine_sine(-yaw, &cosine, &sine);
    for (int64_t i = 0; i < 3 * count; i += 3) {
        place(0.0, 0.0, cosine, sine, poses[i] - x, poses[i + 1] - y, seen + i);
        seen[i + 2] = wrap(poses[i + 2] - yaw);
    }
}

int64_t read_ranges(double *ranges, int64_t count, double least, double most, double *nearest)
{
    const double low = larger(least * (1.0 - 1e-6), 5e-324), high = most * (1.0 + 1e-6), free = most * (1.0 - 1e-6);
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
