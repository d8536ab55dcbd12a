/* The safety layer: what is left of a velocity that a driver wants. zteam.robot.safety.layer has the rules, kernels.h
   what goes in and what is remembered. All is in metres, radians and seconds, and in the frame of the base. */
#include <string.h>
#include "kernels.h"
#include "outlines.h"
#include "sines.h"

#define DEGREES (PI / 180.0)
#define SPIN_MARGIN 0.01   /* free around a base that turns on the spot: less than what `wander` squeezes through */
#define DRIVE_MARGIN 0.025 /* free beside one that drives: what the odometry and the laser are wrong by */
#define GAP 0.15           /* free before a base that has stopped */
#define HYSTERESIS 0.05    /* more that has to be free before one that was stopped drives the same way again */
#define SLOWEST 0.02       /* m/s of the fastest corner: what has to be slower stands, so that nothing crawls */
#define UNSEEN_SPEED 0.2   /* m/s of the fastest corner, at most, where no laser looks: what was never seen is met so */
#define SHORTEST 0.05      /* until the next command, at least, whatever the last step took */
#define FIRST 2.0          /* until the next command that the first step is safe for: no tick is known yet */
#define FIRST_TICK 0.1     /* and that it reckons with */
#define STRAIGHT 1e-5      /* an arc that turns less is straight: on a metre that is wrong by less than 0.01 mm */
/* By so much the base may come nearer, in each look, to what is nearer than the margin already: it may drive along a
   wall that it does not quite see as straight. What is nearer than CLOSEST it may not come nearer to, but by rounding:
   between beams 0.5 degrees apart so much of a corner is unseen. */
#define TOUCH 1e-3
#define CLOSEST 2e-3
#define ROUNDING 1e-6
#define TINY 1e-9          /* what numbers are wrong by */
#define LEAST 1e-6         /* m/s, rad/s: no base moves so slowly, and a way divided by less would be no number */
#define STOPPING 2.5       /* m/s²: how hard a base without limits is stopped when data is old or a leader is gone */
#define TURN_STOPPING 8.0  /* rad/s²: an erratic then stands within 0.4 s, and so within 0.5 s of the loss */
#define FASTER 0.02        /* m/s, rad/s more than commanded that odometry may say for nothing */
#define STALE 500000000    /* ns after which the word of a beam, or a pose that explains its silence, is too old */
#define DAZZLE (5.0 * DEGREES) /* to either side of a teammate: its laser dazzles, by 2 degrees in the simulator */
#define NARROW (15.0 * DEGREES) /* to either side of its way that a laser has to see for a drive forwards */
#define LOOKS 6            /* places on an arc at which is looked whether beams towards it say something */
#define TEAMMATE_GAP 0.3   /* between two outlines */
#define FOLLOWING_GAP 0.1  /* to one that recedes: a chain with 0.8 m from base to base has 0.45 m between erratics */
#define RECEDES 0.05       /* m/s */
#define GRACE 0.3          /* that a pose may be old for nothing: transforms come over the aggregator */
#define GROWTH 0.25        /* m/s by which an outline grows whose pose is older, or its own speed if that is more */
#define MAX_GROWTH 0.5
#define FORGET_AFTER 5.0   /* after which a pose says nothing: the robot was taken away, or its transforms never come */
#define BODY 0.1           /* beside a teammate within which a hit is on that one */
#define APART 0.2          /* between two outlines of a teammate on its way, at most: less than any robot is long */
#define MOST_OUTLINES 1000.0
#define SPAN 3.0           /* of travel that is remembered: longer, and the odometry's error outgrows the margins */
#define REACH 4.0          /* from the laser that is remembered: more than SPAN and a braking distance */
#define BEYOND 0.5         /* beyond its braking way that a base sees what stands around */
#define SEEN_WITHIN 0.05   /* that a point may seem to lie behind what a beam met and still be the same */
#define FINEST DEGREES     /* of such beams the nearest hit is a point: 5 mm apart where an erratic's corners turn */
#define PUT 0.02           /* that a base may back up where it was put down and still has room to turn */
#define WEARS 0.5          /* of way behind it that a base no longer knows when it has turned by a radian */

enum { FREE, NO_NUMBER, BLIND, UNSEEN, STOPPED };
enum { AHEAD, BEHIND, BESIDE };

typedef struct { double x, y, turn; } velocity;
typedef struct { double x, y; } point;
static const velocity STANDING = {0.0, 0.0, 0.0};

static double larger(double a, double b) { return a > b ? a : b; }
static double smaller(double a, double b) { return a < b ? a : b; }
static double within(double value, double low, double high) { return larger(low, smaller(high, value)); }
static double length(double x, double y) { return y != 0.0 ? sqrt(x * x + y * y) : fabs(x); }
static double wrap(double angle) { return angle - TAU * rint(angle / TAU); }
static int is_finite(double number) { return fabs(number) < INFINITY; }
static double speed_of(velocity v) { return length(v.x, v.y); }
static int are_equal(velocity a, velocity b) { return a.x == b.x && a.y == b.y && a.turn == b.turn; }
static int is_standing(velocity v) { return are_equal(v, STANDING); }
static velocity scale(velocity v, double share) { return (velocity){v.x * share, v.y * share, v.turn * share}; }

static frame frame_at(double x, double y, double yaw)
{
    frame f = {.x = x, .y = y};
    cosine_sine(yaw, &f.cosine, &f.sine);
    return f;
}

/* Where a point of a frame is outside, and where a point outside is in it. */
static point from_frame(frame f, double x, double y)
{
    return (point){f.x + f.cosine * x - f.sine * y, f.y + f.sine * x + f.cosine * y};
}

static point to_frame(frame f, double x, double y)
{
    double dx = x - f.x, dy = y - f.y;
    return (point){f.cosine * dx + f.sine * dy, f.cosine * dy - f.sine * dx};
}

/* Where a base is after so long, in its frame of now. */
static frame move_on(velocity v, double seconds)
{
    frame f = frame_at(0.0, 0.0, v.turn * seconds);
    int turns = fabs(v.turn * seconds) >= STRAIGHT;
    double ahead = turns ? f.sine / v.turn : seconds, aside = turns ? (1.0 - f.cosine) / v.turn : 0.0;
    return (frame){v.x * ahead - v.y * aside, v.x * aside + v.y * ahead, f.cosine, f.sine};
}

/* Limits of a base */

int motion_of(const base_limits *b, const double *wanted, double *motion)
{
    velocity v = {wanted[0], b->aside > 0.0 ? wanted[1] : 0.0, wanted[2]};
    if (!(is_finite(v.x) && is_finite(v.y) && is_finite(v.turn)))
        return 0;
    if (b->is_car) {
        frame wheels = frame_at(0.0, 0.0, v.turn);
        v.x = within(v.x, b->low, b->high);
        v = (velocity){v.x * wheels.cosine, 0.0, v.x * wheels.sine / b->wheelbase};
    }
    motion[0] = within(fabs(v.x) >= LEAST ? v.x : 0.0, b->low, b->high);
    motion[1] = within(fabs(v.y) >= LEAST ? v.y : 0.0, -b->aside, b->aside);
    motion[2] = within(fabs(v.turn) >= LEAST ? v.turn : 0.0, -b->turn, b->turn);
    return 1;
}

void command_of(const base_limits *b, const double *motion, double *command)
{
    double x = motion[0], turn = motion[2];
    memcpy(command, motion, 3 * sizeof *command);
    if (b->is_car) {
        command[0] = copysign(length(x, turn * b->wheelbase), x) * (x != 0.0);
        command[2] = x != 0.0 ? angle_of(fabs(x), copysign(turn, turn * x) * b->wheelbase) : 0.0;
    }
}

/* Seconds that braking along an arc takes. */
static double stop_time(const base_limits *b, velocity v)
{
    double straight = larger(fabs(v.x) / b->braking[v.x < 0.0], fabs(v.y) / b->aside_braking);
    return b->is_car ? straight : larger(straight, fabs(v.turn) / b->turn_braking);
}

/* `wanted`, but at most `gain` faster and `loss` slower than `last`; turning round means losing speed first. */
static double approach_part(double wanted, double last, double gain, double loss)
{
    double left = fabs(last) - loss, size = smaller(larger(fabs(wanted), left), fabs(last) + gain);
    if (wanted * last < 0.0)
        return left > 0.0 ? copysign(left, last) : copysign(smaller(fabs(wanted), gain), wanted);
    return copysign(size, wanted == 0.0 ? last : wanted);
}

/* What comes of `wanted` in `seconds` within the limits of acceleration, if the base has any. */
static velocity approach(const base_limits *b, velocity wanted, velocity last, double seconds)
{
    double spin = b->spin * seconds, swerve = b->swerve * seconds;
    if (!b->accelerates)
        return wanted;
    velocity v = {
        approach_part(wanted.x, last.x, b->gain[wanted.x < 0.0] * seconds, b->loss[last.x < 0.0] * seconds),
        approach_part(wanted.y, last.y, swerve, swerve),
        /* The wheels of a car that slows down take its turn with them. */
        approach_part(wanted.turn, last.turn, spin, b->is_car ? INFINITY : spin),
    };
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
    double straight = speed_of(last) / STOPPING, turning = b->is_car ? 0.0 : fabs(last.turn) / TURN_STOPPING;
    double longest = b->accelerates ? stop_time(b, last) : larger(straight, turning);
    return longest > seconds ? scale(last, 1.0 - seconds / longest) : STANDING;
}

/* When a point is met */

/* Points (2, n) in a frame. */
typedef struct { const double *x, *y; int64_t count; frame at; } cloud;

/* An arc that is looked at, and what holds all that the base sweeps on it with the margin: a disc, and a ring about the
   centre of the arc, or a strip along a straight one. */
typedef struct {
    const base_limits *base;
    velocity motion;
    double seconds, margin, x, y, radius, inner, outer;
    int is_straight;
} sweep;

/* How far a point is from the centre of the arc, or to the left of a straight one. */
static double aside_of(const sweep *s, double x, double y)
{
    velocity v = s->motion;
    double u = x + v.y / v.turn, w = y - v.x / v.turn;
    return s->is_straight ? (v.x * y - v.y * x) / speed_of(v) : sqrt(u * u + w * w);
}

static sweep sweep_of(const base_limits *b, velocity v, double seconds, double clearance)
{
    double speed = speed_of(v), fastest = speed + fabs(v.turn) * b->radius;
    double margin = SPIN_MARGIN + (DRIVE_MARGIN - SPIN_MARGIN) * (fastest > 0.0 ? speed / fastest : 0.0) + clearance;
    frame middle = move_on(v, 0.5 * seconds);
    sweep s = {b, v, seconds, margin, middle.x, middle.y, 0.5 * speed * seconds + b->radius + margin,
               INFINITY, -INFINITY, fabs(v.turn * seconds) < STRAIGHT};
    for (const double *corner = b->corners; corner < b->corners + 2 * b->tips; corner += 2) {
        s.inner = smaller(s.inner, aside_of(&s, corner[0], corner[1]));
        s.outer = larger(s.outer, aside_of(&s, corner[0], corner[1]));
    }
    if (!s.is_straight)
        s.inner = depth_of(-v.y / v.turn, v.x / v.turn, b->planes, b->sides);
    return s;
}

/* Seconds until a base that drives straight on has a point within `limit` of all half-planes at once. */
static double meet_straight(point p, double limit, const base_limits *b, velocity v)
{
    double enters = 0.0, leaves = INFINITY;
    for (const double *plane = b->planes; plane < b->planes + 3 * b->sides; plane += 3) {
        /* Adding 0 makes 0 of -0, which would turn infinities round. */
        double closing = v.x * plane[0] + v.y * plane[1] + 0.0;
        double crossed = (plane[0] * p.x + plane[1] * p.y - plane[2] - limit) / closing;
        /* A point on the edge of a half-plane that the base moves along is no number, and in it. */
        if (closing < 0.0)
            leaves = crossed < leaves ? crossed : leaves;
        else
            enters = crossed > enters ? crossed : enters;
    }
    return enters <= leaves ? enters : INFINITY;
}

/* The same for a base that turns about a centre. */
static double meet_turning(point p, double limit, const base_limits *b, velocity turning)
{
    double centre_x = -turning.y / turning.turn, centre_y = turning.x / turning.turn;
    double side = turning.turn < 0.0 ? -1.0 : 1.0, met = INFINITY;
    double u = p.x - centre_x, v = p.y - centre_y, square = u * u + v * v, away = sqrt(square);
    if (!(away > TINY))
        return met;
    for (const double *plane = b->planes; plane < b->planes + 3 * b->sides; plane += 3) {
        /* Seen from the base, the point goes round the centre: a cos + c sin of the angle is how far towards the plane.
           Where that is `reach`, and becomes less, the point comes in: at the solution of a quadratic equation. */
        double a = plane[0] * u + plane[1] * v, c = side * (plane[0] * v - plane[1] * u);
        double reach = within(plane[2] - plane[0] * centre_x - plane[1] * centre_y + limit, -away, away);
        double root = sqrt((away - reach) * (away + reach));
        double cosine = (a * reach - c * root) / square, sine = (c * reach + a * root) / square;
        double there_x = centre_x + cosine * u + side * sine * v, there_y = centre_y + cosine * v - side * sine * u;
        if (depth_of(there_x, there_y, b->planes, b->sides) <= limit + TINY) {
            double turned = angle_of(cosine, sine);
            met = smaller(turned < 0.0 ? turned + TAU : turned, met);
        }
    }
    return met / fabs(turning.turn);
}

/* Seconds until the base comes nearer than the margin to a point of `count` copies of a cloud, each a step further on;
   inf: it does not within the sweep. Where it is nearer than that now, what counts is when it comes nearer still to
   that point, or as near to another: so it may always move away, and along a wall. */
static double meet_copies(const sweep *s, const cloud *points, double count, double step_x, double step_y)
{
    const base_limits *b = s->base;
    /* Half-planes are less than a right angle apart: at a corner they are so much further out than the margin. */
    double margin = s->margin, apart = 1.42 * margin + TINY, first = INFINITY;
    for (int is_second = 0; is_second < 2; is_second++)
        for (double copy = 0.0; copy < count; copy++) {
            frame at = points->at;
            at.x += copy * step_x, at.y += copy * step_y;
            for (int64_t i = 0; i < points->count; i++) {
                point p = from_frame(at, points->x[i], points->y[i]);
                double dx = p.x - s->x, dy = p.y - s->y;
                if (!(dx * dx + dy * dy <= s->radius * s->radius))
                    continue;
                if (is_second) {
                    double aside = aside_of(s, p.x, p.y);
                    if (aside < s->inner - apart || aside > s->outer + apart)
                        continue;
                } else if (p.x * p.x + p.y * p.y > (b->radius + apart) * (b->radius + apart))
                    continue;
                double depth = depth_of(p.x, p.y, b->planes, b->sides), limit, met;
                if (!is_second) {
                    margin = CLOSEST < depth && depth < margin ? depth : margin;
                    continue;
                }
                /* Where it is nearer than the margin now, it may come a little nearer. */
                limit = larger(depth - TOUCH, smaller(depth - ROUNDING, CLOSEST));
                limit = smaller(margin, limit);
                met = s->is_straight ? meet_straight(p, limit, b, s->motion) : meet_turning(p, limit, b, s->motion);
                first = met < first ? met : first;
            }
        }
    return first <= s->seconds ? first : INFINITY;
}

double meet(const base_limits *b, const double *motion, double seconds, double clearance, const double *points,
            int64_t count)
{
    sweep s = sweep_of(b, (velocity){motion[0], motion[1], motion[2]}, seconds, clearance);
    cloud all = {points, points + count, count, frame_at(0.0, 0.0, 0.0)};
    return meet_copies(&s, &all, 1.0, 0.0, 0.0);
}

/* The share of its speed at which a base may drive that has `free` seconds at its full speed, of the fastest corner. */
static double share_of(double free, double braking, double reaction, double fastest)
{
    double share = (sqrt(reaction * reaction + 2.0 * braking * free) - reaction) / braking;
    if (free <= 0.0 || free >= reaction + 0.5 * braking)
        return free > 0.0;
    return share * fastest >= SLOWEST ? share : 0.0;
}

/* The share of its speed at which it can stop before these points: `gap` before them, as far as it drives and not
   turns, and beside its way the margin and `clearance`. */
static double admissible(const safety_memory *m, velocity v, double gap, double clearance, const cloud *points,
                         double count, double step_x, double step_y)
{
    double speed = speed_of(v), fastest = speed + fabs(v.turn) * m->base->radius;
    double braking = stop_time(m->base, v), kept = speed / (fastest * fastest) * gap + m->extra / fastest;
    sweep s = sweep_of(m->base, v, m->reaction + 0.5 * braking + kept, clearance);
    return share_of(meet_copies(&s, points, count, step_x, step_y) - kept, braking, m->reaction, fastest);
}

/* Teammates */

static void look_at_mates(safety_memory *m, const safety_inputs *in)
{
    const double *here = in->own_row < 0 ? NULL : in->poses + 4 * in->own_row;
    int is_here = here && is_finite(here[0] + here[1] + here[2]);
    m->here_yaw = is_here ? here[2] : 0.0;
    for (teammate *t = m->mates; t < m->mates + m->mate_count; t++) {
        const double *pose = in->poses + 4 * t->row;
        int64_t stamp = (int64_t)pose[3], ahead = stamp ? stamp - in->now : 0;
        double seconds = 1e-9 * (double)(stamp - t->stamp), age = -1e-9 * (double)ahead;
        int goes_on = t->is_known && seconds >= 0.0 && stamp;
        t->is_known = is_finite(pose[0] + pose[1] + pose[2]) && age <= FORGET_AFTER && is_here;
        t->explains = t->is_known && ahead <= STALE && ahead >= -STALE;
        if (!t->is_known)
            continue;
        if (!goes_on || seconds > 0.0) {
            t->speed_x = goes_on ? (pose[0] - t->x) / seconds : 0.0;
            t->speed_y = goes_on ? (pose[1] - t->y) / seconds : 0.0;
            if (sqrt(t->speed_x * t->speed_x + t->speed_y * t->speed_y) > t->base->too_fast)
                t->speed_x = t->speed_y = 0.0;
        }
        t->x = pose[0], t->y = pose[1], t->stamp = stamp, t->age = larger(0.0, age);
        point at = to_frame(frame_at(here[0], here[1], here[2]), pose[0], pose[1]);
        t->at = frame_at(at.x, at.y, pose[2] - here[2]);
        t->bearing = angle_of(at.x - m->laser_x, at.y - m->laser_y);
    }
}

/* The share of its speed at which the base can stop before a teammate, on all its way until it stands. */
static double share_before(const safety_memory *m, const teammate *t, velocity v)
{
    double speed = sqrt(t->speed_x * t->speed_x + t->speed_y * t->speed_y), radius = t->base->radius;
    double way = speed * (t->age + m->reaction + 0.5 * speed / t->base->least_braking);
    double growth = t->age <= GRACE ? 0.0 : smaller(MAX_GROWTH, (t->age - GRACE) * larger(speed, GROWTH));
    cloud border = {t->base->border, t->base->border + t->base->edge, t->base->edge, t->at};
    point leaves = to_frame(frame_at(0.0, 0.0, m->here_yaw), t->speed_x, t->speed_y);
    double away = length(t->at.x, t->at.y), braking = stop_time(m->base, v);
    /* No arc leads further. */
    double reach = (m->reaction + braking) * speed_of(v) + TEAMMATE_GAP + m->extra + 2.0 * m->base->radius + 0.1;
    if (away > reach + radius + way + growth)
        return 1.0;
    if (leaves.x * t->at.x + leaves.y * t->at.y > RECEDES * away)
        /* It comes no nearer, should it stop at once. */
        return admissible(m, v, FOLLOWING_GAP, growth, &border, 1.0, 0.0, 0.0);
    way = smaller(way, away + reach + radius);
    double count = smaller(ceil(way / APART), MOST_OUTLINES), step = count > 0.0 ? way / count / speed : 0.0;
    return admissible(m, v, TEAMMATE_GAP, growth, &border, count + 1.0, leaves.x * step, leaves.y * step);
}

/* What stands around */

/* The robot is somewhere else. */
static void forget(safety_memory *m)
{
    m->count = m->silent_count = m->has_beams = 0;
    m->travelled = m->backing = m->middle = m->half = 0.0;
    m->range = INFINITY, m->whole = INT64_MIN / 2;
    for (size_t i = 0; i < sizeof m->heard / sizeof *m->heard; i++)
        m->heard[i] = INT64_MIN / 2;
}

/* Keep a known point, as the next of those that are kept. */
static void keep(safety_memory *m, int64_t *kept, int64_t i)
{
    for (int row = 0; row < 3; row++)
        m->known[row * m->room + *kept] = m->known[row * m->room + i];
    ++*kept;
}

/* The base is where odometry says. */
static void move(safety_memory *m, const double *odom, double reach)
{
    if (odom && !is_finite(odom[0] + odom[1] + odom[2])) {
        if (m->has_pose)
            return;
        odom = NULL;
    }
    point by = {odom ? odom[0] - m->pose[0] : 0.0, odom ? odom[1] - m->pose[1] : 0.0};
    double way = sqrt(by.x * by.x + by.y * by.y);
    if (!m->has_pose || !odom || way > reach) {
        /* It was set down here, or it is not known where the points are now. */
        forget(m);
        m->has_pose = odom != NULL;
    } else if (memcmp(odom, m->pose, sizeof m->pose)) {
        point at = to_frame(frame_at(0.0, 0.0, m->pose[2]), by.x, by.y);
        double turn = wrap(odom[2] - m->pose[2]), *x = m->known, *y = m->known + m->room;
        frame now = frame_at(at.x, at.y, turn), half = frame_at(0.0, 0.0, 0.5 * turn);
        for (int64_t i = 0; i < m->count; i++) {
            point p = to_frame(now, x[i], y[i]);
            x[i] = p.x, y[i] = p.y;
        }
        m->travelled += way;
        int forwards = half.cosine * at.x + half.sine * at.y > 0.9 * way;
        m->backing = forwards ? smaller(SPAN, m->backing + way) : m->backing - way;
        m->backing = larger(smaller(0.0, m->backing), m->backing - WEARS * fabs(turn));
    }
    for (int i = 0; i < 3; i++)
        m->pose[i] = odom ? odom[i] : 0.0;
}

/* Drop the points that the scan tells of, and those that are far or old; add its hits, the nearest of every few. */
static void see(safety_memory *m, const laser_scan *in, double far)
{
    const double stride = copysign(larger(fabs(in->step), 1e-6), in->step), beams = (double)in->beams;
    const double around = larger(1.0, rint(TAU / fabs(stride))), few = floor(larger(1.0, FINEST / fabs(stride) + 1e-6));
    int64_t kept = 0;
    for (int64_t i = 0; i < m->count; i++) {
        double dx = m->known[i] - m->laser_x, dy = m->known[m->room + i] - m->laser_y, away = sqrt(dx * dx + dy * dy);
        double beam = rint((angle_of(dx, dy) - in->start) / stride);
        beam -= around * floor(beam / around);
        int told = beam >= 0.0 && beam < beams && in->distances[(int64_t)beam] >= away - SEEN_WITHIN;
        if (!told && away <= far && m->known[2 * m->room + i] >= m->travelled - SPAN)
            keep(m, &kept, i);
    }
    for (double i = 0.0; i < beams && kept < m->room; i += few) {
        double distance = far;
        int64_t nearest = -1;
        for (int64_t j = (int64_t)i; j < in->beams && (double)j < i + few; j++)
            if (in->distances[j] < distance)
                distance = in->distances[nearest = j];
        if (nearest < 0)
            continue;
        m->known[kept] = m->laser_x + distance * in->axes[nearest];
        m->known[m->room + kept] = m->laser_y + distance * in->axes[in->beams + nearest];
        m->known[2 * m->room + kept++] = m->travelled;
    }
    m->count = kept;
}

/* When a beam last spoke in the sector of `odom` to which one points: it does so for the others of its sector. */
static int64_t *heard_at(safety_memory *m, double bearing)
{
    const double sectors = sizeof m->heard / sizeof *m->heard;
    double sector = (bearing + m->pose[2]) * (sectors / TAU);
    return m->heard + (int64_t)(sector - sectors * floor(sector / sectors)) % (int64_t)sectors;
}

/* Take a scan: what it shows, and which of its beams have been silent for a while. */
static void take_scan(safety_memory *m, const laser_scan *in, int64_t now, double reach)
{
    m->has_beams = in->beams > 0;
    if (!m->has_beams)
        return;
    m->silent_count = 0;
    m->middle = in->start + 0.5 * in->step * (double)(in->beams - 1);
    m->half = 0.5 * fabs(in->step) * (double)in->beams;
    see(m, in, larger(REACH, reach));
    if (!in->silent) {
        m->whole = now;
        return;
    }
    /* The beams were then where they are now, or nearly so. */
    for (int64_t i = 0; i < in->beams && m->whole > 0; i++)
        *heard_at(m, in->angles[i]) = m->whole;
    m->whole = m->whole > 0 ? -1 : m->whole;
    for (int64_t i = 0; i < in->beams; i++)
        if (in->distances[i] == in->distances[i])
            *heard_at(m, in->angles[i]) = now;
    for (int64_t i = 0; i < in->beams; i++)
        if (in->distances[i] != in->distances[i] && *heard_at(m, in->angles[i]) < now - STALE)
            m->silent[m->silent_count++] = in->angles[i];
}

/* Whether the laser looks to all bearings within `spare` (rad) of one. */
static int looks(const safety_memory *m, double bearing, double spare)
{
    return m->half > 3.1 || fabs(wrap(bearing - m->middle)) + spare <= m->half;
}

/* Forget the points at teammates that the laser does not see wholly. Their poses say where they are, and hits on them
   would stay when they have driven on. */
static void forget_mates(safety_memory *m)
{
    for (const teammate *t = m->mates; t < m->mates + m->mate_count; t++) {
        if (!t->is_known || t->age > GRACE)
            continue;
        double away = larger(length(t->at.x, t->at.y), t->base->radius);
        if (!(away < REACH) || looks(m, angle_of(t->at.x, t->at.y), t->base->radius / away))
            continue;
        /* As in meet_copies: further away than this no point is so near to the half-planes. */
        double apart = 1.42 * (t->base->radius + BODY);
        int64_t kept = 0;
        for (int64_t i = 0; i < m->count; i++) {
            point p = to_frame(t->at, m->known[i], m->known[m->room + i]);
            if (p.x * p.x + p.y * p.y > apart * apart || depth_of(p.x, p.y, t->base->planes, t->base->sides) > BODY)
                keep(m, &kept, i);
        }
        m->count = kept;
    }
}

/* Whether a beam from the laser that says nothing points into the way; those towards teammates are explained. */
static int is_blind(const safety_memory *m, velocity v, double seconds)
{
    const base_limits *b = m->base;
    double low = INFINITY, high = -INFINITY, towards = angle_of(v.x, v.y);
    for (int look = 1; look <= LOOKS; look++) {
        frame at = move_on(v, larger(seconds, 0.3 / speed_of(v)) / LOOKS * look);
        for (const double *corner = b->corners; corner < b->corners + 2 * b->tips; corner += 2) {
            point p = from_frame(at, corner[0], corner[1]);
            double bearing = angle_of(p.x - m->laser_x, p.y - m->laser_y);
            if (depth_of(p.x, p.y, b->planes, b->sides) > 0.0 && fabs(wrap(bearing - m->middle)) <= m->half) {
                low = smaller(low, wrap(bearing - towards));
                high = larger(high, wrap(bearing - towards));
            }
        }
    }
    for (int64_t i = 0; i < m->silent_count; i++) {
        double off = wrap(m->silent[i] - towards);
        int is_in_way = off >= low && off <= high;
        for (const teammate *t = m->mates; is_in_way && t < m->mates + m->mate_count; t++)
            is_in_way = !(t->explains && fabs(wrap(m->silent[i] - t->bearing)) <= DAZZLE);
        if (is_in_way)
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
    double *parts[] = {&v.x, &v.y, &v.turn};
    for (int i = 0; m->is_faster && i < 3; i++)
        if (*parts[i] != 0.0)
            *parts[i] = copysign(larger(fabs(*parts[i]), fabs(m->measured[i])), *parts[i]);
    return v;
}

/* Take the velocity that odometry says: whether the base is faster than it was told to be in some part. */
static void measure(safety_memory *m, const double *odom)
{
    m->is_faster = 0;
    for (int i = 0; odom && i < 3; i++) {
        m->measured[i] = i == 1 && !(m->base->aside > 0.0) ? 0.0 : odom[3 + i];
        m->is_faster |= fabs(m->measured[i]) > fabs(m->motion[i]) + FASTER;
    }
    m->is_faster &= is_finite(m->measured[0] + m->measured[1] + m->measured[2]);
}

/* The share of its speed at which a motion can stop before all; the robot that it would meet first, or -1. */
static double share_of_motion(const safety_memory *m, velocity v, int64_t *met)
{
    cloud around = {m->known, m->known + m->room, m->count, frame_at(0.0, 0.0, 0.0)};
    double least = admissible(m, v = real_of(m, v), GAP, 0.0, &around, 1.0, 0.0, 0.0);
    *met = -1;
    for (const teammate *t = m->mates; t < m->mates + m->mate_count; t++) {
        double share = t->is_known ? share_before(m, t, v) : 1.0;
        if (share < least || (share == least && share < 1.0 && *met < 0)) {
            least = share;
            *met = t->robot_id;
        }
    }
    return least;
}

/* A motion as far as the ground that it leads over is seen. */
static velocity slow_down_unseen(safety_memory *m, velocity asked, int64_t *cause)
{
    velocity v = real_of(m, asked);
    if (is_standing(v))
        return asked;
    double braking = stop_time(m->base, v), speed = speed_of(v), way = angle_of(v.x, v.y);
    double seconds = m->reaction + 0.5 * braking, bend = within(0.5 * v.turn * seconds, -1.0, 1.0), share = 1.0;
    int forwards = v.x > 0.0 && fabs(v.y) <= 0.5 * v.x;
    m->side = side_of(asked);
    if (m->has_beams ? speed != 0.0 && m->silent_count && is_blind(m, v, seconds) : forwards) {
        *cause = BLIND;
        return (velocity){.turn = asked.turn};
    }
    /* A laser has to see a little to either side of a way forwards, and else as far as the base is wide. */
    int is_seen = speed == 0.0 || (forwards ? looks(m, way + bend, NARROW) : looks(m, way, 0.5 * PI));
    /* The corners come to ground that was seen, or the base was put down there. */
    int has_room = m->backing >= -PUT || looks(m, 0.0, PI);
    if (is_seen && !(v.turn != 0.0 && !has_room)) {
        /* What is beyond its range no laser has seen. */
        share = forwards ? share_of(m->range / speed, braking, m->reaction, speed) : 1.0;
    } else {
        double fastest = 0.0;
        for (const double *corner = m->base->corners; corner < m->base->corners + 2 * m->base->tips; corner += 2)
            fastest = larger(fastest, length(v.x - v.turn * corner[1], v.y + v.turn * corner[0]));
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
    int64_t met = -1, other;
    double share = is_standing(v) ? 1.0 : share_of_motion(m, v, &met);
    velocity slow = scale(v, share), turning = {slow.x, slow.y, v.turn}, straight = {v.x, v.y, 0.0};
    if (share >= 1.0)
        return v;
    /* A car turns the less, the more slowly it drives. */
    if (v.turn != 0.0 && speed_of(v) != 0.0 && !m->base->is_car) {
        double free = share_of_motion(m, turning, &other);
        if (free >= 1.0 || share == 0.0)
            slow = scale(turning, free);
        /* The tail of a robot beside a wall has room to drive on, but not to turn. */
        if (is_standing(slow))
            slow = scale(straight, share_of_motion(m, straight, &other));
    }
    if (speed_of(slow) == 0.0 && (speed_of(v) != 0.0 || slow.turn == 0.0)) {
        *cause = STOPPED;
        m->met = met, m->side = side_of(v);
    }
    return slow;
}

/* A motion as far as nothing stands in its way. */
static velocity cut(safety_memory *m, velocity asked, const double *odom, int64_t *cause)
{
    int64_t other = FREE;
    if (is_standing(asked))
        return asked;
    m->extra = m->held == way_of(asked) ? HYSTERESIS : 0.0;
    measure(m, odom);
    velocity slow = slow_down_unseen(m, asked, cause), motion = avoid(m, slow, cause);
    if (!are_equal(motion, slow)) {
        int64_t side = m->side, met = m->met;
        /* It may lead over other ground. A turn on the spot that is left then was not looked at. */
        velocity seen = slow_down_unseen(m, motion, &other);
        side = *cause == FREE ? m->side : side;
        *cause = *cause == FREE ? other : *cause;
        motion = speed_of(seen) != 0.0 || speed_of(motion) == 0.0 ? seen : avoid(m, seen, &other);
        m->met = met, m->side = side;
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
        if (in->seen) {
            m->range = in->range > 0.0 ? in->range : INFINITY;
            m->laser_x = in->laser_x, m->laser_y = in->laser_y;
            take_scan(m, in->seen, in->now, reach);
        }
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
