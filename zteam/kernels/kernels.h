/* What Python calls. It reads this file: lines that begin with # are for C alone. Checks are in binding.py. */
#ifndef ZTEAM_KERNELS_H
#define ZTEAM_KERNELS_H
#include <stdint.h>

/* A bitmap: the largest empty square at every cell, for each quadrant of directions (zteam.simulator.core.casting). */
typedef struct {
    const uint8_t *sides; /* (4, rows * columns + 1) */
    int64_t rows, columns;
    double cell_x, cell_y; /* metres */
    double x, y, yaw;      /* of its lower left corner in `map` */
    double z_min, z_max;   /* metres: what is between meets it */
} bitmap;

/* Rays that fan out from sensors of one kind. */
typedef struct {
    int64_t count, beams;
    const double *at;              /* (3, count): x, y, yaw in `map` */
    const double *z;               /* (count) */
    const int64_t *owner;          /* (count): the mover that carries the sensor and that it does not see, or -1 */
    int64_t tables;                /* rows of the next two: 1 for all scans, or one for each */
    const double *cosine, *sine;   /* (tables, beams): directions in the sensor's frame */
    double angle_min, increment;   /* radians */
    double jitter;                 /* increments that a beam may be off its place */
    double limit;                  /* metres */
    double *ranges;                /* (count, beams), metres */
    int32_t *hits;                 /* (count, beams): what was met */
    double *tops;                  /* room for a number for every 8 beams */
} fans;

/* Polygons in groups that move together; groups are sorted into bins by their centres. */
typedef struct {
    int32_t shapes, groups, movers;
    const double *local_x, *local_y; /* (vertices), in the mover's frame; in `map` for what stands still */
    double *x, *y;                   /* (vertices), in `map` */
    const int32_t *first_vertex;     /* (shapes + 1) */
    const double *z_min, *z_max;     /* (shapes), metres */
    const int32_t *first_shape;      /* (groups + 1) */
    const int64_t *owner;            /* (groups): the mover, or -1 for what stands still */
    const double *local_centre;      /* (groups, 2) */
    double *centre_x, *centre_y;     /* (groups), in `map` */
    const double *radius;            /* (groups): of the circle about the centre that holds all shapes */
    int32_t *in_bin;                 /* (groups), in the order of their bins */
    int32_t *bin_start;              /* (64 * 64 + 2): bins row by row, then one for groups that are wider than a bin */
    int32_t columns, rows;           /* bins along x and y */
    double bin_x, bin_y, bin_size;   /* metres */
    double reach;                    /* the largest radius of a group in a bin */
    double *corner_x, *corner_y;     /* room for the corners of a shape */
} polygons;

/* The bases of all robots; rows are x, y (m/s, m) and yaw (rad/s, rad), in the base frame but for poses. */
typedef struct {
    int64_t robots, wheels;
    const double *low, *high;    /* (robots, 3): velocity */
    const double *slow, *fast;   /* (robots, 3): acceleration */
    const uint8_t *is_car;       /* (robots) */
    const double *wheelbase;     /* (robots), metres */
    double *setpoint, *velocity; /* (robots, 3): as commanded, within the limits; as it was */
    const double *start;         /* (robots, 3): where odometry is zero, in `map` */
    double *odom;                /* (robots, 3): the pose seen from there */
    const int64_t *wheel_owner;  /* (wheels) */
    const double *wheel_rows;    /* (wheels, 3): rad/s for each unit of velocity */
    double *angles, *rates;      /* (wheels): rad, rad/s */
} bases;

/* Bodies of Chipmunk, robots first, and its functions of one body. */
typedef struct {
    double x, y;
} vector;
typedef struct {
    int64_t count, robots;
    void *const *bodies;            /* (count) */
    const double *mass;             /* (robots), kg */
    const uint8_t *in_wall, *held;  /* (count): which nothing moves; whose way was cut short in this tick */
    double *ways;                   /* (robots, 3): metres and radians in `map`, for this tick */
    uint8_t *touching;              /* (robots): what touches something; the contacts that begin are added */
    uint8_t *met, *stalled;         /* (robots): what something may have hindered; what made less than half its way */
    vector (*get_position)(const void *), (*get_velocity)(const void *);
    double (*get_angle)(const void *);
    void (*set_velocity)(void *, vector), (*set_force)(void *, vector);
    void (*set_angular_velocity)(void *, double);
    void (*each_arbiter)(void *, void (*)(void *, void *, void *), void *);
} chipmunk;

/* hashes.c */
/* Write outputs 1 to `many` of SplitMix64 from each state: (count, many). */
void hash_counters(const uint64_t *states, int64_t count, int64_t many, uint64_t *out);

/* squares.c: rays against a bitmap */
int has_avx2(void);
void fill_squares(const uint8_t *free_cells, int64_t rows, int64_t columns, uint8_t *out);
void cast_squares(const bitmap *map, const fans *s, int32_t mark);
void cast_squares_avx2(const bitmap *map, const fans *s, int32_t mark);

/* edges.c: rays against polygons */
void cast_edges(const polygons *o, const fans *all);

/* bodies.c: what moves, and what it meets */
void move_polygons(polygons *o, const double *poses);
void find_overlaps(const polygons *o, const bitmap *maps, int64_t count, int apart, uint8_t *found);
void move_all(polygons *o, const bitmap *maps, int64_t count, int64_t robots, double *poses, const double *ends,
              uint8_t *blocked);
void hold(polygons *o, const bitmap *maps, int64_t count, const double *half, const double *poses, double *ends,
          const uint8_t *suspects, const uint8_t *tangled, int apart, double *places, double *shares);

/* bases.c: what bases do */
void obey(bases *b, const double *commands, const uint8_t *fresh, double seconds);
void follow(int64_t robots, const double *poses, const double *velocity, double seconds, int tangents, double *ends);
void note_motion(bases *b, const double *before, const double *after, double seconds, int tangents);
int place_mounts(
    int64_t count, const int64_t *owner, const double *mounts, int64_t robots, const double *poses, double *rays);

/* chipmunk.c: bodies of Chipmunk */
double plan_ways(const chipmunk *c, const double *poses, const double *velocity, double seconds);
void drive_bodies(const chipmunk *c, double share, double seconds, double step, int is_first);
void read_bodies(const chipmunk *c, double *poses);
void judge_ways(const chipmunk *c, const double *poses, const double *ends, double share, double least);

/* costmaps.c: grids of costs */
void inflate(const uint8_t *costs, int64_t rows, int64_t columns, const int64_t *window, int64_t reach, uint8_t *steps,
             uint16_t *line, uint16_t *squares, const uint8_t *table, int64_t unknown_from, uint8_t *out);
/* A scan as planning takes it. */
typedef struct {
    const float *ranges; /* (beams), metres */
    int64_t beams;
    double start, step, least, most; /* the first angle, the increment, in radians; the limits of ranges, in metres */
    double x, y, yaw;                /* of the laser in the base frame */
} planar_scan;

/* A costmap: a grid, its layers (rows, columns), and the outline of a robot. */
typedef struct {
    int64_t rows, columns;
    double x, y, cosine, sine, cell, yaw; /* its origin in `map`, and metres a cell */
    uint8_t *fixed, *seen, *base, *costs; /* the map; what lasers have seen; both, and teammates; the same, inflated */
    const uint8_t *table;                 /* costs by squared distance in cells, up to that of `reach` + 1 */
    int64_t reach, unknown_from;          /* from this cost on a cell without information gets one */
    int64_t changed[4];                   /* rows and columns, from and to: where layers have changed since the update */
    const double *outline;                /* (corners, 2), metres in the base frame */
    int64_t corners;
    double radius;                        /* metres to the farthest corner */
    double *room;                         /* (4, corners) */
} costmap;

void change_all(costmap *c);
/* Lie elsewhere: what was cell (rows, columns) is (0, 0). What lasers have seen keeps its place. */
void move_costmap(costmap *c, int64_t rows, int64_t columns);
/* Clear and mark cells as the scan of a base at a pose says; what is met on a teammate (x, y, radius) or up to `margin`
   beside it is not marked. `limits`: metres up to which a beam clears, and marks. `ends` (3 * beams), `met` (beams) and
   `cells` (4 * beams) are room. Return whether all are near enough; else nothing is changed. */
int observe(costmap *c, const planar_scan *s, const double *base, const double *mates, int64_t mate_count, double margin,
            const double *limits, double *ends, uint8_t *met, int64_t *cells);
/* Clear what lasers have seen where the middle of a cell lies in the outline at a pose. */
void clear_outline(costmap *c, const double *pose);
/* Something changes within a disc (x, y, radius); `forget`: what lasers have seen there. */
void change_disc(costmap *c, const double *disc, int forget);
/* Join the layers where they have changed, and inflate that part, whose box is written. Return whether there is any; -1
   without memory. */
int update_costmap(costmap *c, const double *mates, int64_t mate_count, int64_t *box);
int cost_at(const costmap *c, double x, double y);
/* Seconds until the outline on an arc touches a lethal cell that it does not touch at the start; or inf. */
double time_to_collision(const costmap *c, const double *pose, const double *velocity, double duration);

/* A robot at (x, y) follows a path (count, 3: x, y, yaw), of which `along` (count) has the metres from its beginning.
   Return the nearest pose from `at` on, within `ahead` metres. */
int64_t find_place(const double *path, const double *along, int64_t count, int64_t at, double ahead, double x, double y);
/* Return the first pose from `at` on that is not nearer to (x, y) than `reach` metres; -1 if there is none. */
int64_t leave_circle(const double *path, int64_t count, int64_t at, double reach, double x, double y);

/* search.c: ways over grids of weights */
void weigh_cells(const uint8_t *costs, int64_t rows, int64_t columns, int64_t neutral, int64_t factor, int64_t barred,
                 int64_t unknown, uint8_t *out);
int search(const uint8_t *weights, int64_t columns, int64_t start, int64_t goal, const int64_t *steps,
           uint32_t *costs, int64_t *box);
int64_t trace(const uint8_t *weights, int64_t columns, int64_t start, int64_t goal, const int64_t *steps,
              const uint32_t *costs, int64_t *out, int64_t room);
void measure_lines(const uint8_t *weights, int64_t columns, const int64_t *begins, const int64_t *ends, int64_t count,
                   double *out);
int64_t straighten(const uint8_t *weights, int64_t rows, int64_t columns, const int64_t *way, int64_t count,
                   int64_t stride, int64_t reach, int64_t spacing, double least, double *best, int64_t *before,
                   int64_t *spaced, int64_t *moved, int64_t *out);
int64_t lay_path(const double *points, int64_t count, double yaw, double spacing, double *out);

/* A map's likelihoods, with a border of one cell, and where the map lies. */
typedef struct {
    const uint16_t *values; /* (rows, columns) */
    int64_t rows, columns;
    double x, y, yaw, cosine, sine, cell; /* its lower left corner in `map`, and metres a cell */
} likelihoods;

/* particles.c: localisation */
void move_poses(double *poses, int64_t count, const double *motion, const double *draws);
void sum_poses(const likelihoods *f, const double *poses, int64_t count, const float *beams, int64_t many, int64_t *out);
void climb(const likelihoods *f, double *poses, int64_t count, const float *beams, int64_t many, double step,
           double turn, int64_t halvings, int64_t most, int64_t *sums);
int64_t resample(const double *poses, const double *sums, int64_t count, const double *draws, const uint8_t *strange,
                 int64_t most, const int64_t *enough, int64_t limits, const double *size, int64_t *table, int64_t mask,
                 int64_t *guide, double *out);
void find_cluster(const double *poses, const double *weights, int64_t count, const double *size, int64_t turns,
                  int64_t *table, int64_t mask, int64_t *cluster, int64_t *stack, double *totals, int64_t *labels,
                  double *mean, double *covariance);

/* A pose, with the cosine and the sine of its yaw. */
typedef struct {
    double x, y, cosine, sine;
} frame;

/* A base: its hull and its limits. A limit that it does not report is infinite; braking is then a default. */
typedef struct {
    const double *planes;           /* (sides, 3): half-planes of the hull, as outlines.h has them */
    const double *corners, *border; /* (tips, 2); (2, edge): points on the outline; metres */
    int64_t sides, tips, edge;
    double radius;                  /* metres from the origin to the furthest corner */
    double low, high, aside, turn;  /* m/s forwards, from and to; m/s to either side; rad/s */
    double gain[2], loss[2];        /* m/s² forwards and backwards: how much speed it gains, or loses, at most */
    double swerve, spin;            /* m/s² to the side, rad/s² */
    double braking[2], aside_braking, turn_braking; /* how hard it brakes */
    double least_braking;           /* m/s²: along the way on which it brakes least */
    double wheelbase;               /* metres */
    double too_fast;                /* m/s: one that seems faster was set down elsewhere */
    uint8_t is_car, accelerates;    /* accelerates: whether it has limits of acceleration at all */
} base_limits;

/* A teammate as one robot knows it. */
typedef struct {
    const base_limits *base;
    int64_t row, robot_id;             /* of the poses that come */
    int64_t stamp;                     /* ns: when it was there; 0: it never moves */
    double x, y, speed_x, speed_y;     /* in `map`: metres, m/s */
    frame at;                          /* in the base frame */
    double age, bearing;               /* seconds; where it is from the laser */
    uint8_t is_known, explains;        /* whether its pose is; whether it explains beams that say nothing */
} teammate;

/* What the safety layer of one robot remembers. */
typedef struct {
    const base_limits *base;
    teammate *mates;
    int64_t mate_count;
    double *known;             /* (3, room): points, and how far the base had travelled when each was seen; metres */
    double *silent;            /* bearings, from the laser, of beams that have said nothing for a while */
    int64_t count, silent_count, room;
    double pose[3], travelled; /* in `odom`, of the frame in which points are; metres */
    double backing;            /* metres that it may back up over ground that it drove over; below 0: over other */
    double laser_x, laser_y, range, middle, half; /* the laser: where, how far, and to which bearings it looks */
    int64_t heard[360], whole; /* ns: when a beam of each sector of `odom` spoke last, and all of them at once */
    double motion[3];          /* what the base was told to do last */
    double command[3];         /* the same as its command: of a car the angle of the wheels is last */
    double measured[3];        /* odometry's velocity, if the base is faster than it was told to be (is_faster) */
    double here_yaw;           /* in `map` */
    double reaction, extra;    /* seconds until the next command; metres that are to be free besides the gaps */
    int64_t held;              /* which way the motion went that was stopped last; 0: none */
    int64_t met, side;         /* of the cause: the robot, -1 for an obstacle; 0 ahead, 1 behind, 2 beside */
    uint8_t has_pose, has_beams, is_faster;
} safety_memory;

/* A scan as it was read. */
typedef struct {
    const double *angles, *axes; /* bearings, and their cosines and sines (2, beams) */
    const double *distances;     /* metres; NaN: the beam says nothing */
    int64_t beams, silent;       /* how many there are, and how many of them say nothing */
    double start, step;          /* radians: the first angle, the increment */
} laser_scan;

/* What comes in a step. */
typedef struct {
    const laser_scan *seen;      /* NULL: no new one */
    double range, laser_x, laser_y;
    const double *odom;    /* (6): pose in `odom` and velocity */
    const double *poses;   /* (rows, 4): of robots in `map`, NaN where not known, and their stamps in ns */
    int64_t own_row, now;
    double dt;             /* seconds since the last step; 0: it is the first, or there was a pause */
    uint8_t is_old, lacks; /* whether there is no usable scan, and whether a stop is due to data that is lacking */
} safety_inputs;

/* safety.c */
/* Write the motion and the command that are left of a wanted command (3) to the memory; return why: 0 nothing, 1 it is
   no number, 2 blind, 3 the laser does not look there, 4 it is stopped. */
int64_t limit(safety_memory *m, const safety_inputs *in, const double *wanted);
/* What the base makes of a command within its limits of speed (0: it is no number), and the command that makes that. */
int motion_of(const base_limits *base, const double *wanted, double *motion);
void command_of(const base_limits *base, const double *motion, double *command);
/* Seconds until a base on an arc first comes nearer to a point of (2, count) than the margin and clearance; or inf. */
double meet(const base_limits *base, const double *motion, double seconds, double clearance, const double *points,
            int64_t count);

/* view.c */
/* Transform poses (count, 4: x, y, yaw and a time) into the frame of one of them, (count, 3: x, y, yaw). */
void see_poses(const double *poses, int64_t count, int64_t own, double *seen);
/* Make distances of the ranges of a scan, as zteam.messages.laser says; what is too close to measure is at `closest`.
   Return how many beams say nothing. */
int64_t read_ranges(const float *ranges, int64_t count, double least, double most, double closest, double *distances,
                    double *nearest);
/* Write where the beams of a base at a pose end (x, y) that say something, and whether each met something that is not on
   a teammate (x, y, radius) or up to `margin` beside it; and where the laser is. A beam longer than `far` ends there.
   Of all beams `wanted` are looked at, spread evenly. `ends` has room for 3 numbers a beam. Return how many there are. */
int64_t find_ends(const planar_scan *s, const double *base, double far, int64_t wanted, const double *mates,
                  int64_t mate_count, double margin, double *laser, double *ends, uint8_t *met);
/* The same, of those that met something. */
int64_t find_hits(const planar_scan *s, const double *base, double far, int64_t wanted, const double *mates,
                  int64_t mate_count, double margin, double *ends, uint8_t *met);
/* Metres to the nearest hit in a corridor; it looks no further once a hit is nearer than enough. */
double look_along(const laser_scan *seen, double half_width, double heading, double enough);
/* The first of some headings whose corridor is clear for some reach, or -1. */
int64_t first_clear(const laser_scan *seen, double half_width, double reach, const double *headings, int64_t count);

/* What stands around a base, and where it is to get: in its frame, in metres. Places are the middles of 85 * 85 cells;
   the base stands on the middle one. */
typedef struct {
    const double *headings; /* (16, 5), counter-clockwise from ahead: cells of a step (up to 2), yaw, cosine, sine */
    const double *away;     /* (85, 85): how far a place is */
    const double *planes;   /* (sides, 3): half-planes of the base's hull */
    int64_t sides;
    const double *points; /* (count, 2): on what stands around, and behind the first `hits` on teammates */
    int64_t count;
    const double *way; /* (stops, 2) */
    int64_t stops;
    const double *shunned; /* (shunned_count, 2) */
    int64_t shunned_count;
    const double *failed; /* (failed_count, 4): moves that did not work: the kind, and x, y and yaw where */
    int64_t failed_count;
    int64_t hits;
    double radius, cell;          /* of the circle that holds the base; side of a cell */
    double leaves, least, beside; /* without a way: how far it leads if there is room, at least, and from `shunned` */
} surroundings;

/* escape.c: moves along a way, or away. Write the kind of each, and the pose at its end, to the end of (200, 4); return
   how many they are, -1 without memory. */
int64_t find_moves(const surroundings *s, double *moves);

/* Points joined by straight pieces. A place on it is metres along it from its first point, also once that is dropped. */
typedef struct {
    double *rows;               /* (room, 3), allocated here: x, y and place of a point, from row `first` on */
    int64_t room, first, count; /* count: points */
    double start, end;          /* the places of its beginning and of its last point */
} polyline;

/* Where a robot has driven that leads. Poses are x, y (m) and yaw (rad) in `map`. */
typedef struct {
    polyline *path;            /* up to a little behind it */
    double leader[3], first[3]; /* the newest pose, and the one at the beginning of the path */
    double place, speed;       /* of the leader on the trail (m, m/s), as far as can be told */
    double noise;              /* metres: the mean deviation of a pose from the place that was expected; 0: not known */
    int64_t has_turned, count; /* whether the path ends where the leader turned round; how many samples there are */
    double samples[128][4];    /* the newest poses: place, x, y, yaw; one is room for the leader's */
    double ahead[2];           /* of a robot that follows: where the robot ahead of it was seen last */
    int64_t ahead_stamp;       /* when that was (ns) */
    double leaves, steadily;   /* m/s at which that one drives away, negative where it comes nearer; the same smoothed */
    int64_t moves, is_parked;  /* whether that one drives at all; whether the robot stands behind a standing leader */
} trail;

/* polylines.c. What is no number is not appended, and is a place before the first one. 0 without a point or memory. */
void free_points(polyline *p);
int append_point(polyline *p, double x, double y);
/* Forget what lies before a place, but for the last piece; or what lies behind it: it becomes the end. */
void drop_before(polyline *p, double s);
void cut_after(polyline *p, double s);
/* The point at a place, or the end nearest to it, and the direction there (0 of a single point). */
int find_pose(const polyline *p, double s, double *pose);
/* The place from low to high nearest to a point, the first of equal ones, and the metres from there to the point. */
int find_nearest(const polyline *p, double x, double y, double low, double high, double *found);
/* The place of the first point from low to high that is within some metres of this one; high without any. */
double find_beside(const polyline *p, double x, double y, double within, double low, double high);
/* The velocity (m/s, rad/s) of a robot at a pose (m, m, cosine and sine) that keeps to a path from its place `s` on, by the
   point that is `ahead` metres further on. The limits are m/s, rad/s and m/s² to the side. 0 without a point. */
int pursue(const polyline *p, const double *pose, double s, double ahead, double speed, const double *limits,
           double *velocity);
/* Begin a trail whose path and poses are set. */
void begin_trail(trail *t);
/* The leader's pose so many seconds after the last one; forget what lies more than `keep` metres behind it. Return 0 if it
   is no number or not later, -1 if there is no last one or it is too far from that. */
int extend_trail(trail *t, double x, double y, double yaw, double seconds, double keep);
/* A robot at `own` and its `place` (m) on the trail belongs `back` metres behind the leader. The robot ahead of it is
   `apart` metres away. Times are in ns; a stamp of 0 has none. Write the speed (m/s), the metres that it is behind where it
   belongs, and those that the robot ahead has driven away since its pose; return whether that one comes past to its place. */
int follow_trail(trail *t, const double *own, double place, double back, double x, double y, double apart,
                 int64_t stamp, int64_t leader_stamp, int64_t now, double *found);
/* The pose at a place, or so far to the left of it, straight on before the beginning and ahead; its curvature (1/m). */
void find_trail_pose(trail *t, double place, double lateral, double *pose);
double trail_curvature(trail *t, double place);

/* The name of a frame or of a sender in UTF-8. Equal names of a buffer have one place. */
typedef struct {
    const uint8_t *text;
    int64_t size;
} tf_name;

/* parent_from_child at a time (ns): x, y, z (m) and a unit quaternion x, y, z, w. */
typedef struct {
    int64_t stamp;
    const tf_name *parent;
    double pose[7];
} tf_sample;

/* The edge from a frame to its parent. A static one has one sample, which holds at all times. */
typedef struct {
    tf_sample *samples;         /* (room), allocated here; by ascending stamps from `first` on */
    int64_t room, first, count;
    const tf_name *child, *authority; /* the sender of the sample that came last */
    int64_t is_static, cache; /* ns: samples that are so much older than the newest one are forgotten */
} tf_edge;

/* A moving edge of a path, which leads down it or up, and the static transform to the next one. */
typedef struct {
    const tf_edge *edge;
    int64_t is_down;
    double after[7];
} tf_step;

/* From a frame to another one. */
typedef struct {
    double first[7]; /* the static transform before the first step */
    const tf_step *steps;
    int64_t count;
} tf_path;

/* A transform in a message of `tf`: where its names are among the bytes, and the rest. */
typedef struct {
    int64_t stamp, sec, nanosec, parent, parent_size, child, child_size;
    double pose[7];
} tf_row;

/* How far the square of a quaternion's length may be from 1: that is the rounding of doubles. */
#define TF_ROUNDING 1e-15

/* transforms.c. a_from_c of a_from_b and b_from_c; b_from_a of a_from_b. */
void compose(const double *a, const double *b, double *out);
void invert(const double *a, double *out);
void free_samples(tf_edge *e);
/* Whether all samples have one parent; how many are older than a time. */
int has_one_parent(const tf_edge *e);
int64_t count_before(const tf_edge *e, int64_t time);
/* Add a sample with a new stamp, and forget old ones. 0 without memory. */
int add_sample(tf_edge *e, int64_t stamp, const tf_name *parent, const double *pose);
/* Add one that has the parent of the newest one if that is sure: 1, or 0 if it is the newest one again. -1: not sure. */
int take_sample(tf_edge *e, int64_t stamp, const double *pose, const tf_name *authority);
/* Do so with the transforms of a message from one on, until one is not sure or later than `latest`; return which. */
int64_t take_transforms(tf_edge *const *edges, int64_t known, const uint8_t *bytes, const tf_row *rows, int64_t from,
                        int64_t count, const tf_name *authority, int64_t latest, int64_t *repeated);
/* The newest time that all moving edges of a path have; 0 if none moves. A stamp of 0 is none. */
int64_t newest_time(const tf_path *p);
/* target_from_source (7) and its yaw (rad) at a time; 0 where an edge has no data. */
int solve_path(const tf_path *p, int64_t time, double *found);
/* The newest planar poses (count, 4: m, m, rad, ns) and their stamps; return how many are not known: NaN and 0, INT64_MIN. */
int64_t solve_newest(const tf_path *const *paths, int64_t count, double *poses, int64_t *stamps);
/* Read so many TransformStamped of little-endian CDR, and return the end, or -1: none that is usual. */
int64_t read_transforms(const uint8_t *bytes, int64_t at, int64_t end, int64_t count, tf_row *rows);

/* A scan in which some hits are on other robots. */
typedef struct {
    const double *axes, *distances; /* (2, beams): cosines and sines; (beams), metres */
    int64_t beams;
    const double *mates; /* (count, 2): where they are */
    int64_t count;
    double body; /* metres around one within which a hit is that robot */
} walls;

/* formations.c */
/* The cheapest assignment of (count, count) costs: the column of each row is written to `found` from count + 1 on. There
   is room for 3 (count + 1) numbers in both. */
void assign(const double *costs, int64_t count, double *work, int64_t *found);
/* How far walls are to the left and to the right of places (count, 4: x, y, cosine and sine), at least, of those that
   are so far behind to so far ahead of one, within `side` and less than `bound` from the laser; infinite without any. */
void find_sides(const walls *w, double bound, const double *places, int64_t count, double behind, double ahead,
                double side, double *least);
/* Whether the nearest wall and the nearest one `across` radians from it are less than `width` apart in sum, and more
   than `opposite` radians from each other, or `facing` where the laser looks no further. */
int is_between(const walls *w, const double *angles, double width, double across, double opposite, double facing);

#endif
