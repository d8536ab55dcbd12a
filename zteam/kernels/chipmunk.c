/* Bodies of Chipmunk, by its own functions: Python would call each of them for each body. */
#include "kernels.h"

static void note(void *body, void *arbiter, void *found)
{
    (void)body, (void)arbiter;
    *(uint8_t *)found = 1;
}

/* Set the robots' velocities to `targets` (robots, 3; m/s, m/s, rad/s in `map`), which is done at the first step of a
   tick alone. One that touches something is driven by a force instead, at every step: it has the velocity by the end of
   `seconds`, unless a contact objects. */
void drive_bodies(const chipmunk *c, const double *targets, double seconds, int is_first)
{
    for (int64_t i = 0; i < c->robots; i++) {
        void *body = c->bodies[i];
        const double *target = targets + 3 * i;
        if (is_first)
            c->set_angular_velocity(body, target[2]);
        if (c->touching[i]) {
            vector now = c->get_velocity(body);
            double push = c->mass[i] / seconds;
            c->set_force(body, (vector){push * (target[0] - now.x), push * (target[1] - now.y)});
        } else if (is_first) {
            c->set_velocity(body, (vector){target[0], target[1]});
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

/* Whether the robots that touched something still do. */
void find_touching(const chipmunk *c)
{
    for (int64_t i = 0; i < c->robots; i++)
        if (c->touching[i]) {
            c->touching[i] = 0;
            c->each_arbiter(c->bodies[i], note, c->touching + i);
        }
}
