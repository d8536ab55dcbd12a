/* Prints a hash of what the kernels compute in a drawn world. Every compiler and processor must give the same. */
#include "kernels.h"
#include "sines.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { ROWS = 200, COLUMNS = 300, STRIDE = ROWS * COLUMNS + 1, MOVERS = 20, GROUPS = 60, BEAMS = 1081, SCANS = 200 };

static uint64_t hash = 14695981039346656037u; /* FNV-1a */

/* A drawn number from `low` to below `high`. */
static double drawn(double low, double high)
{
    static uint64_t state = 1;
    state = state * 6364136223846793005u + 1442695040888963407u;
    return low + (high - low) * ((double)(state >> 11) / 9007199254740992.0);
}

/* Take bytes into the hash. */
static void add(const void *data, size_t size)
{
    for (size_t i = 0; i < size; i++)
        hash = (hash ^ ((const uint8_t *)data)[i]) * 1099511628211u;
}

/* Say which part has been reached with which hash. */
static void tell(const char *part)
{
    printf("%s %016llx\n", part, (unsigned long long)hash);
}

static uint8_t sides[4 * STRIDE];
static const bitmap map = {sides, ROWS, COLUMNS, 0.05, 0.05, -7.0, -5.0, 0.1, 0.0, 1.0};

/* Occupy a twentieth of the cells, and find the squares of every quadrant. */
static void fill_map(void)
{
    static uint8_t cells[ROWS][COLUMNS], mirrored[ROWS][COLUMNS];
    for (int row = 0; row < ROWS; row++)
        for (int column = 0; column < COLUMNS; column++)
            cells[row][column] = drawn(0.0, 1.0) > 0.05;
    for (int quadrant = 0; quadrant < 4; quadrant++) {
        for (int row = 0; row < ROWS; row++)
            for (int column = 0; column < COLUMNS; column++)
                mirrored[row][column] = cells[quadrant & 2 ? ROWS - 1 - row : row]
                                             [quadrant & 1 ? COLUMNS - 1 - column : column];
        fill_squares(mirrored[0], ROWS, COLUMNS, sides + quadrant * STRIDE);
    }
    add(sides, sizeof sides);
    tell("squares");
}

static double local_x[4 * GROUPS], local_y[4 * GROUPS], x[4 * GROUPS], y[4 * GROUPS], low[GROUPS], high[GROUPS];
static double centre[GROUPS][2], centre_x[GROUPS], centre_y[GROUPS], radius[GROUPS], corners[2][4];
static int32_t first_vertex[GROUPS + 1], first_shape[GROUPS + 1], in_bin[GROUPS], bin_start[64 * 64 + 2];
static int64_t owner[GROUPS];
static double poses[MOVERS][3];
static polygons things = {
    GROUPS, GROUPS, MOVERS, local_x, local_y, x, y, first_vertex, low, high, first_shape, owner, centre[0],
    centre_x, centre_y, radius, in_bin, bin_start, .corner_x = corners[0], .corner_y = corners[1],
};

/* Rectangles: one for each mover, the rest stand still. */
static void fill_polygons(void)
{
    for (int i = 0; i < GROUPS; i++) {
        double across = drawn(0.05, 0.4), along = drawn(0.05, 0.4);
        double at_x = i < MOVERS ? 0.0 : drawn(-7.0, 8.0), at_y = i < MOVERS ? 0.0 : drawn(-5.0, 5.0);
        const double corner_x[4] = {-across, across, across, -across}, corner_y[4] = {-along, -along, along, along};
        for (int k = 0; k < 4; k++) {
            x[4 * i + k] = local_x[4 * i + k] = at_x + corner_x[k];
            y[4 * i + k] = local_y[4 * i + k] = at_y + corner_y[k];
        }
        first_vertex[i + 1] = 4 * (i + 1);
        first_shape[i + 1] = i + 1;
        owner[i] = i < MOVERS ? i : -1;
        high[i] = 1.0;
        centre_x[i] = centre[i][0] = at_x;
        centre_y[i] = centre[i][1] = at_y;
        radius[i] = sqrt(across * across + along * along);
    }
    for (int i = 0; i < MOVERS; i++)
        poses[i][0] = drawn(-7.0, 8.0), poses[i][1] = drawn(-5.0, 5.0), poses[i][2] = drawn(-4.0, 4.0);
    move_polygons(&things, poses[0]);
    add(x, sizeof x), add(y, sizeof y);
    tell("polygons");
}

/* Cast fans from anywhere, some of them outside the bitmap, against the bitmap and then against the polygons. */
static void cast(int64_t beams)
{
    static double at[3][SCANS], z[SCANS], cosine[BEAMS], sine[BEAMS], tops[BEAMS / 8 + 1], ranges[SCANS * BEAMS];
    static int64_t carrier[SCANS];
    static int32_t hits[SCANS * BEAMS];
    const double fov = 1.5 * PI, increment = beams > 1 ? fov / (double)(beams - 1) : 0.0;
    fans all = {SCANS, beams, at[0], z, carrier, 1, cosine, sine, -0.5 * fov, increment, 0.0, 30.0, ranges, hits, tops};
    size_t rays = (size_t)(SCANS * beams);
    for (int i = 0; i < SCANS; i++) {
        at[0][i] = drawn(-9.0, 10.0), at[1][i] = drawn(-7.0, 7.0), at[2][i] = drawn(-9.0, 9.0), z[i] = 0.2;
        carrier[i] = i % MOVERS;
    }
    for (int64_t i = 0; i < beams; i++)
        cosine_sine(-0.5 * fov + (double)i * increment, &cosine[i], &sine[i]);
    for (int wide = 0; wide < 2; wide++) {
        for (size_t i = 0; i < rays; i++)
            ranges[i] = 30.0, hits[i] = -1;
#ifdef __x86_64__
        (wide && has_avx2() ? cast_squares_avx2 : cast_squares)(&map, &all, 7);
#else
        cast_squares(&map, &all, 7);
#endif
        add(ranges, rays * sizeof *ranges), add(hits, rays * sizeof *hits);
    }
    tell("bitmap");
    cast_edges(&things, &all);
    add(ranges, rays * sizeof *ranges), add(hits, rays * sizeof *hits);
    tell("edges");
}

/* Drive all movers a few steps, each way cut to what is free. */
static void drive(void)
{
    static double velocity[MOVERS][3], noted[MOVERS][3], odom[MOVERS][3], start[MOVERS][3], ends[MOVERS][3];
    static double places[MOVERS], shares[MOVERS], half[GROUPS];
    bases b = {.robots = MOVERS, .velocity = noted[0], .odom = odom[0], .start = start[0]};
    static uint8_t suspects[MOVERS], tangled[MOVERS], found[MOVERS];
    memset(suspects, 1, sizeof suspects);
    for (int i = 0; i < GROUPS; i++)
        half[i] = 0.05;
    for (int step = 0; step < 20; step++) {
        for (int i = 0; i < MOVERS; i++) {
            velocity[i][0] = drawn(-2.0, 2.0), velocity[i][1] = drawn(-0.2, 0.2), velocity[i][2] = drawn(-3.0, 3.0);
            shares[i] = 1.0;
        }
        follow(MOVERS, poses[0], velocity[0], 0.1, step % 2, ends[0]);
        note_motion(&b, poses[0], ends[0], 0.1, step % 2);
        find_overlaps(&things, &map, 1, 1, found);
        hold(&things, &map, 1, half, poses[0], ends[0], suspects, tangled, 1, places, shares);
        memcpy(poses, ends, sizeof poses);
        move_polygons(&things, poses[0]);
        add(poses, sizeof poses), add(noted, sizeof noted), add(odom, sizeof odom), add(shares, sizeof shares), add(found, sizeof found);
    }
    tell("bodies");
}

/* Particles move, and a scan is compared with a field at each of them. */
static void localise(void)
{
    enum { PARTICLES = 1000, ENDS = 60 };
    static double particles[3 * PARTICLES], draws[3 * PARTICLES];
    static float ends[2 * ENDS];
    static uint16_t values[ROWS * COLUMNS];
    static int64_t sums[PARTICLES];
    const double motion[6] = {0.1, 0.3, -0.2, 0.02, 0.05, 0.03};
    const likelihoods field = {values, ROWS, COLUMNS, -7.0, -5.0, 0.1, 0.995, 0.0998, 0.05};
    for (int i = 0; i < ROWS * COLUMNS; i++)
        values[i] = (uint16_t)drawn(0.0, 65535.0);
    for (int i = 0; i < 3 * PARTICLES; i++)
        particles[i] = drawn(-7.0, 7.0), draws[i] = drawn(-2.0, 2.0);
    for (int i = 0; i < 2 * ENDS; i++)
        ends[i] = (float)drawn(-100.0, 100.0);
    move_poses(particles, PARTICLES, motion, draws);
    sum_poses(&field, particles, PARTICLES, ends, ENDS, sums);
    climb(&field, particles, 20, ends, ENDS, 0.1, 0.1, 4, 30, sums);
    add(particles, sizeof particles), add(sums, sizeof sums);
    tell("particles");
}

/* A base is to drive on drawn arcs, among drawn hits and teammates. */
static void look(void)
{
    enum { SEEN = 500, MATES = 3, ROOM = 9000 };
    static double angles[SEEN], axes[2][SEEN], distances[SEEN], known[3 * ROOM], silent[SEEN], border[2][4], tips[4][2];
    static float ranges[SEEN];
    static teammate mates[MATES];
    const double planes[4][3] = {{1.0, 0.0, 0.13}, {-1.0, 0.0, 0.23}, {0.0, 1.0, 0.17}, {0.0, -1.0, 0.17}};
    const base_limits base = {planes[0], tips[0], border[0], 4, 4, 4, 0.29, -1.0, 1.0, 0.0, 3.0, {1.5, 1.0}, {1.0, 1.0},
                              INFINITY, 4.0, {1.0, 1.0}, 1.0, 4.0, 1.0, 0.2, 3.0, 0, 1};
    safety_memory m = {.base = &base, .mates = mates, .mate_count = MATES, .known = known, .silent = silent, .room = ROOM};
    const laser_scan seen = {angles, axes[0], distances, SEEN, 1, -2.0, 4.0 / SEEN};
    double odom[6] = {0.0}, poses_now[MATES + 1][4], found[MATES + 1][3], nearest;
    safety_inputs in = {.seen = &seen, .range = 30.0, .laser_x = 0.05, .odom = odom, .poses = poses_now[0], .dt = 0.1};
    for (int i = 0; i < 4; i++) {
        tips[i][0] = border[0][i] = i % 3 ? 0.13 : -0.23;
        tips[i][1] = border[1][i] = i < 2 ? -0.17 : 0.17;
        if (i < MATES)
            mates[i].base = &base, mates[i].row = mates[i].robot_id = i + 1;
    }
    for (int round = 1; round <= 300; round++) {
        in.now = 100000000LL * round;
        for (int i = 0; i < SEEN; i++) {
            angles[i] = -2.0 + 4.0 * i / SEEN;
            cosine_sine(angles[i], &axes[0][i], &axes[1][i]);
            const double range = drawn(0.4, 5.0);
            ranges[i] = drawn(0.0, 1.0) < 0.02 * (round % 4) ? 0.0f : (float)range;
        }
        read_ranges(ranges, SEEN, 0.1, 30.0, 1e-6, distances, &nearest);
        for (int i = 0; i <= MATES; i++) {
            poses_now[i][0] = i ? drawn(-1.5, 1.5) : odom[0], poses_now[i][1] = i ? drawn(-1.5, 1.5) : odom[1];
            poses_now[i][2] = i ? drawn(-3.0, 3.0) : odom[2], poses_now[i][3] = (double)in.now;
        }
        /* A compiler may draw a call's arguments in any order. */
        const double speed = drawn(-0.5, 1.0), turn = drawn(-1.0, 1.0), wanted[3] = {speed, 0.0, turn};
        const int64_t cause = limit(&m, &in, wanted);
        odom[0] += drawn(0.0, 0.1), odom[1] += drawn(-0.05, 0.05), odom[2] += 0.1 * m.motion[2];
        const double free_way = look_along(&seen, 0.3, turn, -1.0);
        see_poses(poses_now[0], MATES + 1, 0, found[0]);
        add(&cause, sizeof cause), add(m.command, sizeof m.command), add(found, sizeof found), add(&free_way, sizeof free_way);
        for (int row = 0; row < 3; row++)
            add(known + row * ROOM, (size_t)m.count * sizeof *known);
    }
    tell("safety");
}

/* A base in a drawn corner looks for ways out, along ways and without one. */
static void escape(void)
{
    enum { POINTS = 300, SIDE = 85 };
    static double headings[16][5], away[SIDE][SIDE], points[POINTS][2], moves[200][4];
    const double planes[4][3] = {{1.0, 0.0, 0.13}, {-1.0, 0.0, 0.23}, {0.0, 1.0, 0.17}, {0.0, -1.0, 0.17}};
    const int steps[4][2] = {{2, 0}, {2, 1}, {1, 1}, {1, 2}};
    double way[3][2], failed[2][4];
    for (int h = 0; h < 16; h++) {
        double ahead = steps[h % 4][0], aside = steps[h % 4][1];
        for (int quarter = 0; quarter < h / 4; quarter++) {
            const double before = ahead;
            ahead = -aside, aside = before;
        }
        headings[h][0] = ahead, headings[h][1] = aside, headings[h][2] = angle_of(ahead, aside);
        cosine_sine(headings[h][2], &headings[h][3], &headings[h][4]);
    }
    for (int i = 0; i < SIDE; i++)
        for (int j = 0; j < SIDE; j++)
            away[i][j] = 0.05 * sqrt((i - 42) * (i - 42) + (j - 42) * (j - 42));
    for (int round = 0; round < 60; round++) {
        for (int i = 0; i < POINTS; i++)
            points[i][0] = drawn(-2.0, 2.0), points[i][1] = (i % 2 ? 1.0 : -1.0) * drawn(0.3, 1.2);
        for (int i = 0; i < 3; i++)
            way[i][0] = drawn(-2.0, 2.0), way[i][1] = drawn(-0.5, 0.5);
        for (int i = 0; i < 2; i++) {
            failed[i][0] = i + 1.0;
            for (int part = 1; part < 4; part++)
                failed[i][part] = drawn(-0.3, 0.3);
        }
        const surroundings around = {headings[0], away[0], planes[0], 4, points[0], POINTS, way[0], round % 4, way[0], 1,
                                     failed[0], 2, POINTS - 10, 0.29, 0.05, 1.0, 0.6, 0.9};
        const int64_t count = find_moves(&around, moves[0]);
        add(&count, sizeof count), add(moves[200 - count], (size_t)count * sizeof *moves);
    }
    tell("escape");
}

/* A leader drives drawn arcs, is and is seen with drawn errors. */
static void draw_trail(void)
{
    static polyline path;
    static trail led = {.path = &path};
    double pose[3] = {0.0, 0.0, 0.5}, cosine, sine, found[3];
    append_point(&path, pose[0], pose[1]);
    begin_trail(&led);
    for (int i = 0; i < 2000; i++) {
        const double step = drawn(-0.02, 0.08);
        pose[2] += i % 90 < 60 ? 0.02 : -0.06;
        cosine_sine(pose[2], &cosine, &sine);
        pose[0] += step * cosine, pose[1] += step * sine;
        /* A compiler may draw a call's arguments in any order. */
        const double x = pose[0] + drawn(-0.01, 0.01), y = pose[1] + drawn(-0.01, 0.01);
        extend_trail(&led, x, y, pose[2], 0.1, 8.0);
        const double place = drawn(path.start - 1.0, led.place + 1.0), curvature = trail_curvature(&led, place);
        find_trail_pose(&led, place, drawn(-1.0, 1.0), found);
        add(&curvature, sizeof curvature), add(found, sizeof found);
        const double near_x = drawn(-5.0, 5.0), near_y = drawn(-5.0, 5.0);
        find_nearest(&path, near_x, near_y, place - 3.0, place, found);
        add(found, 2 * sizeof *found);
        const double here[4] = {near_x, near_y, cosine, sine}, limits[3] = {0.7, 2.0, 0.5};
        pursue(&path, here, place, 0.3, 0.5, limits, found);
        add(found, 2 * sizeof *found);
        const int64_t now = 100000000LL * i;
        const int64_t comes_past = follow_trail(&led, pose, place, 0.8, near_x, near_y, 2.0, now, now - 70000000, now, found);
        add(&comes_past, sizeof comes_past), add(found, sizeof found);
    }
    free_points(&path);
    tell("trail");
}

/* Robots are assigned to slots, among walls that a laser sees. */
static void form(void)
{
    enum { BEAMS_SEEN = 90, SLOTS = 12, PLACES = 3 };
    static double axes[2][BEAMS_SEEN], distances[BEAMS_SEEN], angles[BEAMS_SEEN], costs[SLOTS][SLOTS];
    double mates[2][2], places[PLACES][4], work[3 * (SLOTS + 1)], least[2];
    int64_t found[3 * (SLOTS + 1)];
    const walls seen = {axes[0], distances, BEAMS_SEEN, mates[0], 2, 0.45};
    for (int round = 0; round < 100; round++) {
        for (int i = 0; i < BEAMS_SEEN; i++) {
            angles[i] = 0.05 * (i - BEAMS_SEEN / 2), distances[i] = drawn(0.2, 2.0);
            cosine_sine(angles[i], &axes[0][i], &axes[1][i]);
        }
        for (int i = 0; i < PLACES; i++) {
            places[i][0] = drawn(-2.0, 2.0), places[i][1] = drawn(-1.0, 1.0);
            cosine_sine(drawn(-1.0, 1.0), &places[i][2], &places[i][3]);
        }
        for (int i = 0; i < 4; i++)
            mates[i / 2][i % 2] = drawn(-2.0, 2.0);
        for (int i = 0; i < SLOTS * SLOTS; i++)
            costs[i / SLOTS][i % SLOTS] = drawn(0.0, 9.0);
        find_sides(&seen, 1.8, places[0], PLACES, 0.5, 1.5, 1.0, least);
        const int64_t between = is_between(&seen, angles, 1.5, 1.9, 2.1, 2.6);
        assign(costs[0], SLOTS, work, found);
        add(least, sizeof least), add(&between, sizeof between), add(found, sizeof found), add(work, sizeof work);
    }
    tell("formations");
}

/* A rigid transform of small drawn numbers. */
static void draw_pose(double *pose)
{
    double square = 0.0;
    for (int i = 0; i < 7; i++)
        pose[i] = drawn(-1.0, 1.0);
    for (int i = 3; i < 7; i++)
        square += pose[i] * pose[i];
    for (int i = 3; i < 7; i++)
        pose[i] /= sqrt(square);
}

/* Frames hang under one another, move, and are looked up between their samples. */
static void look_up(void)
{
    enum { FRAMES = 6, SAMPLES = 400 };
    static const tf_name map = {(const uint8_t *)"map", 3}, team = {(const uint8_t *)"tf", 2};
    static tf_edge edges[FRAMES];
    tf_step steps[FRAMES];
    tf_path path = {.steps = steps, .count = FRAMES};
    const tf_path *const paths[] = {&path};
    double pose[8], found[4];
    int64_t stamp;
    draw_pose(path.first);
    for (int i = 0; i < FRAMES; i++) {
        steps[i].edge = &edges[i], steps[i].is_down = i % 2;
        draw_pose(steps[i].after);
        draw_pose(pose);
        edges[i].cache = 100;
        add_sample(&edges[i], 1, &map, pose);
    }
    for (int64_t time = 2; time < SAMPLES; time++) {
        for (int i = 0; i < FRAMES; i++) {
            draw_pose(pose);
            if (time % (i + 1) == 0 && take_sample(&edges[i], time, pose, &team) < 0)
                add_sample(&edges[i], time, &map, pose);
        }
        stamp = time - (int64_t)drawn(0.0, 20.0);
        if (solve_path(&path, stamp, pose))
            add(pose, sizeof pose);
        solve_newest(paths, 1, found, &stamp);
        add(found, sizeof found), add(&stamp, sizeof stamp);
    }
    for (int i = 0; i < FRAMES; i++)
        free_samples(&edges[i]);
    tell("transforms");
}

/* A costmap moves among drawn scans and teammates, and a way leads over it. */
static void navigate(void)
{
    enum { CELLS = 120, SEEN = 300, REACH = 9, WIDE = CELLS + 2, ROOM = 6 * CELLS * CELLS };
    static uint8_t layers[4][CELLS * CELLS], table[(REACH + 1) * (REACH + 1) + 1], weights[WIDE * WIDE], met[SEEN];
    static uint32_t costs[WIDE * WIDE];
    static double ends[3 * SEEN], best[7 * ROOM], path[3 * ROOM], along[ROOM], hits[CELLS];
    static int64_t cells[4 * SEEN], way[ROOM], points[ROOM], before[7 * ROOM], spaced[2 * ROOM], moved[2 * ROOM];
    static int64_t out[2 * ROOM];
    static float ranges[SEEN];
    static uint64_t hashes[2][SEEN];
    double outline[4][2] = {{0.2, 0.15}, {-0.2, 0.15}, {-0.2, -0.15}, {0.2, -0.15}}, room[4][4];
    costmap c = {CELLS, CELLS, -3.0, -3.0, 0.995, 0.0998, 0.05, 0.1, layers[0], layers[1], layers[2], layers[3], table,
                 REACH, 253, {0, CELLS, 0, CELLS}, outline[0], 4, 0.25, room[0]};
    const planar_scan s = {ranges, SEEN, -2.0, 4.0 / SEEN, 0.1, 5.0, 0.1, 0.0, 0.05};
    const int64_t steps[3] = {70, 99, 50};
    const uint64_t states[2] = {1, 1u << 31};
    int64_t box[4];
    memset(layers[1], 255, sizeof layers[1]);
    for (int i = 0; i <= REACH * REACH; i++)
        table[i] = (uint8_t)(i ? 253 - 3 * i : 254);
    for (int round = 0; round < 20; round++) {
        const double x = drawn(-1.0, 1.0), y = drawn(-1.0, 1.0), turn = drawn(-3.0, 3.0), pose[3] = {x, y, turn};
        const double mate_x = drawn(-2.0, 2.0), mates[3] = {mate_x, 1.5, 0.3}, limits[2] = {3.0, 2.5};
        const double motion[3] = {0.5, 0.0, 0.3 * turn};
        for (int i = 0; i < SEEN; i++)
            ranges[i] = (float)(i % 7 ? drawn(0.5, 4.0) : INFINITY);
        move_costmap(&c, round % 3 - 1, round % 5 - 2);
        observe(&c, &s, pose, mates, 1, 0.1, limits, ends, met, cells);
        clear_outline(&c, pose);
        change_disc(&c, mates, round % 2);
        update_costmap(&c, mates, 1, box);
        hits[round] = time_to_collision(&c, pose, motion, 2.0) + cost_at(&c, x, y);
        const int64_t found = find_hits(&s, pose, 4.0, 60, mates, 1, 0.1, ends, met);
        add(layers, sizeof layers), add(box, sizeof box), add(hits, sizeof hits);
        add(ends, (size_t)found * 2 * sizeof *ends);
    }
    tell("costmaps");
    weigh_cells(layers[3], CELLS, CELLS, 50, 204, 253, 236, weights);
    memset(costs, 255, sizeof costs);
    const int64_t start = 30 * WIDE + 30, goal = 90 * WIDE + 95;
    const int is_found = weights[start] && weights[goal] && search(weights, WIDE, start, goal, steps, costs, box) == 1;
    const int64_t count = is_found ? trace(weights, WIDE, start, goal, steps, costs, way, ROOM) : 0;
    for (int64_t i = 0; i < count; i++)
        points[2 * i] = way[i] % WIDE, points[2 * i + 1] = way[i] / WIDE;
    int64_t corners = 0;
    if (count)
        corners = straighten(weights, WIDE, WIDE, points, count, 4, 320, 20, 50.0, best, before, spaced, moved, out);
    for (int64_t i = 0; i < 2 * corners; i++)
        best[i] = 0.05 * (double)out[i];
    const int64_t poses = lay_path(best, corners, 0.3, 0.05, path);
    for (int64_t i = 1; i < poses; i++)
        along[i] = along[i - 1] + 0.05;
    const int64_t at = poses ? find_place(path, along, poses, 0, 3.0, 2.0, 2.0) : -1;
    const int64_t carrot = poses ? leave_circle(path, poses, at, 0.6, 2.0, 2.0) : -1;
    hash_counters(states, 2, SEEN, hashes[0]);
    add(&count, sizeof count), add(out, (size_t)corners * 2 * sizeof *out), add(path, (size_t)poses * 3 * sizeof *path);
    add(&at, sizeof at), add(&carrot, sizeof carrot), add(hashes, sizeof hashes);
    tell("ways");
}

int main(void)
{
    fill_map();
    fill_polygons();
    cast(BEAMS);
    cast(1);
    drive();
    localise();
    look();
    navigate();
    escape();
    draw_trail();
    form();
    look_up();
    return 0;
}
