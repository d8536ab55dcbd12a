/* Rigid transforms, the edges of a tree of frames over time, and `tf` read from its bytes. A transform is x, y, z (m) and a
   unit quaternion x, y, z, w. Time is in ns. */
#include <stdlib.h>
#include <string.h>
#include "kernels.h"
#include "sines.h"

/* Where the angle of a slerp loses its digits. */
#define ALIKE 1e-12
#define HEADER 4

void compose(const double *a, const double *b, double *out)
{
    double x = a[0], y = a[1], z = a[2], i = a[3], j = a[4], k = a[5], w = a[6];
    double px = b[0], py = b[1], pz = b[2], qi = b[3], qj = b[4], qk = b[5], qw = b[6];
    /* v + 2 q × (q × v + w v): the rotation of a vector by a unit quaternion in 18 products. */
    double cx = j * pz - k * py + w * px, cy = k * px - i * pz + w * py, cz = i * py - j * px + w * pz;
    out[0] = x + px + 2.0 * (j * cz - k * cy);
    out[1] = y + py + 2.0 * (k * cx - i * cz);
    out[2] = z + pz + 2.0 * (i * cy - j * cx);
    out[3] = w * qi + i * qw + j * qk - k * qj;
    out[4] = w * qj + j * qw + k * qi - i * qk;
    out[5] = w * qk + k * qw + i * qj - j * qi;
    out[6] = w * qw - i * qi - j * qj - k * qk;
}

void invert(const double *a, double *out)
{
    double x = a[0], y = a[1], z = a[2], i = -a[3], j = -a[4], k = -a[5], w = a[6];
    double cx = j * z - k * y + w * x, cy = k * x - i * z + w * y, cz = i * y - j * x + w * z;
    out[0] = -x - 2.0 * (j * cz - k * cy);
    out[1] = -y - 2.0 * (k * cx - i * cz);
    out[2] = -z - 2.0 * (i * cy - j * cx);
    out[3] = i, out[4] = j, out[5] = k, out[6] = w;
}

/* At a fraction (0 to 1) between two: linear in place, shortest slerp in rotation, as in tf2. */
static void interpolate(const double *a, const double *b, double fraction, double *out)
{
    double dot = a[3] * b[3] + a[4] * b[4] + a[5] * b[5] + a[6] * b[6], sign = dot < 0.0 ? -1.0 : 1.0;
    double rest = 1.0 - fraction, fa = rest, fb = fraction;
    dot *= sign;
    if (dot <= 1.0 - ALIKE) {
        double sine = sqrt((1.0 - dot) * (1.0 + dot)), angle = angle_of(dot, sine), unused;
        cosine_sine(rest * angle, &unused, &fa);
        cosine_sine(fraction * angle, &unused, &fb);
        fa /= sine, fb /= sine;
    }
    for (int n = 0; n < 3; n++)
        out[n] = rest * a[n] + fraction * b[n];
    for (int n = 3; n < 7; n++)
        out[n] = fa * a[n] + fb * sign * b[n];
}

static tf_sample *sample_of(const tf_edge *e, int64_t n)
{
    return e->samples + e->first + n;
}

int64_t count_before(const tf_edge *e, int64_t time)
{
    int64_t low = 0, high = e->count;
    while (low < high) {
        int64_t middle = (low + high) / 2;
        if (sample_of(e, middle)->stamp < time)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

int has_one_parent(const tf_edge *e)
{
    for (int64_t n = 1; n < e->count; n++)
        if (sample_of(e, n)->parent != sample_of(e, 0)->parent)
            return 0;
    return 1;
}

void free_samples(tf_edge *e)
{
    free(e->samples);
}

int add_sample(tf_edge *e, int64_t stamp, const tf_name *parent, const double *pose)
{
    if (e->first + e->count == e->room) {
        if (2 * e->first > e->count) {
            memmove(e->samples, sample_of(e, 0), e->count * sizeof *e->samples);
            e->first = 0;
        } else {
            int64_t room = 2 * e->room + 2;
            tf_sample *samples = realloc(e->samples, room * sizeof *samples);
            if (!samples)
                return 0;
            e->samples = samples, e->room = room;
        }
    }
    int64_t at = e->count && stamp <= sample_of(e, e->count - 1)->stamp ? count_before(e, stamp) : e->count;
    tf_sample *made = sample_of(e, at);
    memmove(made + 1, made, (e->count - at) * sizeof *made);
    made->stamp = stamp, made->parent = parent;
    memcpy(made->pose, pose, sizeof made->pose);
    e->count++;
    int64_t oldest = sample_of(e, e->count - 1)->stamp - e->cache;
    while (sample_of(e, 0)->stamp < oldest)
        e->first++, e->count--;
    return 1;
}

int take_sample(tf_edge *e, int64_t stamp, const double *pose, const tf_name *authority)
{
    if (e->is_static || !e->count)
        return -1;
    const tf_sample *last = sample_of(e, e->count - 1);
    if (stamp < last->stamp)
        return -1;
    if (stamp == last->stamp)
        /* What is sent again. */
        return memcmp(pose, last->pose, sizeof last->pose) ? -1 : 0;
    double over = pose[3] * pose[3] + pose[4] * pose[4] + pose[5] * pose[5] + pose[6] * pose[6] - 1.0;
    /* A number that is not finite makes the sum NaN. */
    over += (pose[0] + pose[1] + pose[2]) * 0.0;
    if (!(fabs(over) < TF_ROUNDING) || !add_sample(e, stamp, last->parent, pose))
        return -1;
    e->authority = authority;
    return 1;
}

static int is_name(const tf_name *name, const uint8_t *text, int64_t size)
{
    return name->size == size && !memcmp(name->text, text, size);
}

int64_t take_transforms(tf_edge *const *edges, int64_t known, const uint8_t *bytes, const tf_row *rows, int64_t from,
                        int64_t count, const tf_name *authority, int64_t latest, int64_t *repeated)
{
    /* Mostly they come in the order in which the edges were made. */
    int64_t guess = 0;
    for (; from < count; from++) {
        const tf_row *row = rows + from;
        tf_edge *edge = NULL;
        for (int64_t tried = 0; tried < known && !edge; tried++) {
            if (is_name(edges[guess]->child, bytes + row->child, row->child_size))
                edge = edges[guess];
            guess = guess + 1 < known ? guess + 1 : 0;
        }
        if (!edge || !edge->count || row->stamp > latest)
            break;
        if (!is_name(sample_of(edge, edge->count - 1)->parent, bytes + row->parent, row->parent_size))
            break;
        int taken = take_sample(edge, row->stamp, row->pose, authority);
        if (taken < 0)
            break;
        *repeated += !taken;
    }
    return from;
}

/* Of a moving edge; 0 outside of its history. */
static int pose_at(const tf_edge *e, int64_t time, double *pose)
{
    int64_t at = e->count - 1;
    if (at >= 0 && sample_of(e, at)->stamp != time)
        at = count_before(e, time + 1) - 1;
    if (at < 0)
        return 0;
    const tf_sample *older = sample_of(e, at), *newer = older + 1;
    if (older->stamp == time) {
        memcpy(pose, older->pose, sizeof older->pose);
        return 1;
    }
    if (at == e->count - 1)
        return 0;
    /* Samples with different parents cannot be interpolated: the older one holds until the newer one. */
    double span = (double)(newer->stamp - older->stamp);
    double fraction = older->parent == newer->parent ? (double)(time - older->stamp) / span : 0.0;
    interpolate(older->pose, newer->pose, fraction, pose);
    return 1;
}

int64_t newest_time(const tf_path *p)
{
    int64_t newest = 0;
    for (int64_t n = 0; n < p->count; n++) {
        const tf_edge *edge = p->steps[n].edge;
        int64_t stamp = edge->count ? sample_of(edge, edge->count - 1)->stamp : 0;
        if (!newest || (stamp && stamp < newest))
            newest = stamp;
    }
    return newest;
}

int solve_path(const tf_path *p, int64_t time, double *found)
{
    double moved[7], turned[7];
    memcpy(found, p->first, sizeof p->first);
    for (int64_t n = 0; n < p->count; n++) {
        const tf_step *step = p->steps + n;
        if (!pose_at(step->edge, time, moved))
            return 0;
        if (step->is_down) {
            invert(moved, turned);
            memcpy(moved, turned, sizeof moved);
        }
        compose(moved, found, turned);
        compose(step->after, turned, found);
    }
    double x = found[3], y = found[4], z = found[5], w = found[6];
    found[7] = angle_of(1.0 - 2.0 * (y * y + z * z), 2.0 * (w * z + x * y));
    return 1;
}

int64_t solve_newest(const tf_path *const *paths, int64_t count, double *poses, int64_t *stamps)
{
    int64_t failed = 0;
    for (int64_t n = 0; n < count; n++) {
        double found[8], *pose = poses + 4 * n;
        const int64_t time = newest_time(paths[n]);
        if (solve_path(paths[n], time, found)) {
            pose[0] = found[0], pose[1] = found[1], pose[2] = found[7], pose[3] = (double)time;
            stamps[n] = time;
        } else {
            pose[0] = pose[1] = pose[2] = NAN, pose[3] = 0.0;
            stamps[n] = INT64_MIN;
            failed++;
        }
    }
    return failed;
}

/* Where a number of so many bytes begins at or after `at`. */
static int64_t align(int64_t at, int64_t size)
{
    return at + (HEADER - at % size + size) % size;
}

/* A text of plain ASCII at *at, and its size without the NUL; 0 if it is none. */
static int read_text(const uint8_t *bytes, int64_t *at, int64_t end, int64_t *begin, int64_t *size)
{
    uint32_t length;
    *at = align(*at, 4);
    if (end - *at < 4)
        return 0;
    memcpy(&length, bytes + *at, 4);
    *at += 4;
    if (length > end - *at)
        return 0;
    *begin = *at, *at += length;
    /* Some writers send the empty text without its NUL. */
    *size = length ? length - 1 : 0;
    if (length && bytes[*at - 1])
        return 0;
    for (int64_t n = 0; n < *size; n++)
        if (bytes[*begin + n] & 0x80)
            return 0;
    return 1;
}

int64_t read_transforms(const uint8_t *bytes, int64_t at, int64_t end, int64_t count, tf_row *rows)
{
    for (int64_t n = 0; n < count; n++) {
        tf_row *row = rows + n;
        int32_t sec;
        uint32_t nanosec;
        at = align(at, 4);
        if (end - at < 8)
            return -1;
        memcpy(&sec, bytes + at, 4);
        memcpy(&nanosec, bytes + at + 4, 4);
        at += 8;
        row->stamp = sec * INT64_C(1000000000) + nanosec;
        row->sec = sec, row->nanosec = nanosec;
        if (!read_text(bytes, &at, end, &row->parent, &row->parent_size)
            || !read_text(bytes, &at, end, &row->child, &row->child_size))
            return -1;
        at = align(at, 8);
        if (end - at < (int64_t)sizeof row->pose)
            return -1;
        memcpy(row->pose, bytes + at, sizeof row->pose);
        at += sizeof row->pose;
        for (int m = 0; m < 7; m++)
            if (!isfinite(row->pose[m]))
                return -1;
    }
    return at;
}
