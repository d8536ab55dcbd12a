/* Bodies of Chipmunk, by its own functions: Python would call each of them for each body. */
#include "kernels.h"
#include <math.h>

#define BLOCKED 0.5 /* a robot stalls when it touches something and makes less than this share of its way */

/* Plan the ways of the robots at `poses` (robots, 3: x, y, yaw) at constant body velocity; return the longest along x
   or y in metres. */
double plan_ways(const chipmunk *c, const double *poses, const double *velocity, double seconds)
{
    double longest = 0.0;
    follow(c->robots, poses, velocity, seconds, 0, c->ways);
    for (int64_t k = 0; k < 3 * c->robots; k++) {
        c->ways[k] -= poses[k];
        if (k % 3 < 2 && fabs(c->ways[k]) > longest)
            longest = fabs(c->ways[k]);
    }
    return longest;
}

/* Set velocities that make this share of the ways in `seconds`, at the first step of a tick alone. A robot that touches
   something is driven by a force instead, in each step: it has its velocity by the end of the step (seconds), unless a
   contact objects. */
void drive_bodies(const chipmunk *c, double share, double seconds, double step, int is_first)
{
    for (int64_t i = 0; i < c->robots; i++) {
        void *body = c->bodies[i];
        double goal[3];
        for (int axis = 0; axis < 3; axis++)
            goal[axis] = c->in_wall[i] ? 0.0 : c->ways[3 * i + axis] * share / seconds;
        if (is_first)
            c->set_angular_velocity(body, goal[2]);
        if (c->touching[i]) {
            vector now = c->get_velocity(body);
            double push = c->mass[i] / step;
            c->set_force(body, (vector){push * (goal[0] - now.x), push * (goal[1] - now.y)});
        } else if (is_first) {
            c->set_velocity(body, (vector){goal[0], goal[1]});
        }
    }
}

/* Where all bodies are: x, y, yaw in `map`. */
void read_bodies(const chipmunk *c, double *poses)
{
    for (int64_t i = 0; i < c->count; i++) {
        vector at = c->get_position(c->bodies[i]);
        poses[3 * i] = at.x, poses[3 * i + 1] = at.y, poses[3 * i + 2] = c->get_angle(c->bodies[i]);
    }
}

static void note(void *body, void *arbiter, void *found)
{
    (void)body, (void)arbiter;
    *(uint8_t *)found = 1;
}

static double length_of(const double *way)
{
    return sqrt(way[0] * way[0] + way[1] * way[1]);
}

/* After a tick from `poses` to `ends` (robots, 3): what was met, still touches, and stalled; a way of `least` metres or
   less is none. */
void judge_ways(const chipmunk *c, const double *poses, const double *ends, double share, double least)
{
    for (int64_t i = 0; i < c->robots; i++) {
        int barred = c->held[i] || c->in_wall[i];
        double made[2] = {ends[3 * i] - poses[3 * i], ends[3 * i + 1] - poses[3 * i + 1]};
        double told = share * length_of(c->ways + 3 * i);
        c->met[i] = c->touching[i] || barred;
        if (c->touching[i]) {
            c->touching[i] = 0;
            c->each_arbiter(c->bodies[i], note, c->touching + i);
        }
        c->stalled[i] = (c->touching[i] || barred) && told > least && length_of(made) < BLOCKED * told;
    }
}
