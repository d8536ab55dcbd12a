/* Localisation: how well scans fit a map, which particles are drawn, and which belong together.
   A field holds what a beam that ends in a cell is worth (zteam.navigation.planning.likelihood); what is outside of it counts as
   its border. Whole numbers add to the same sum in any order. */
#include <string.h>
#include "kernels.h"
#include "sines.h"

enum { BLOCK = 256 };
#define EMPTY INT64_MIN /* no bin, in a hash table */
/* From a bin to its neighbours along x and y: 64 bins of a turn, and 2^28 along y. */
#define STEP_X ((int64_t)1 << 34)
#define STEP_Y ((int64_t)1 << 6)

/* Turn, drive and turn: move poses as `motion` says, (first turn, way, last turn) and their deviations, times draws. */
void move_poses(double *restrict poses, int64_t count, const double *motion, const double *restrict draws)
{
    for (int64_t i = 0; i < count; i++) {
        double *pose = poses + 3 * i, cosine, sine;
        const double *draw = draws + 3 * i, bearing = pose[2] + (motion[0] - motion[3] * draw[0]);
        const double length = motion[1] - motion[4] * draw[1];
        cosine_sine(bearing, &cosine, &sine);
        pose[0] += length * cosine;
        pose[1] += length * sine;
        pose[2] = bearing + (motion[2] - motion[5] * draw[2]);
    }
}

/* Write the sum of the field's values where the beams of each pose (x, y, yaw) end.
   One beam of all poses of a block after the other: where they end lies together in memory. Seven digits are a
   thousandth of a cell on a map of 10 000 cells. */
void sum_poses(const likelihoods *f, const double *poses, int64_t count, const float *beams, int64_t many, int64_t *out)
{
    const float last_u = (float)(f->columns - 1), last_v = (float)(f->rows - 1);
    const int32_t width = (int32_t)f->columns;
    const uint16_t *values = f->values;
    for (int64_t first = 0; first < count; first += BLOCK) {
        float x[BLOCK], y[BLOCK], cosine[BLOCK], sine[BLOCK];
        uint32_t cells[BLOCK];
        int64_t *restrict sums = out + first;
        const int block = count - first < BLOCK ? (int)(count - first) : BLOCK;
        for (int i = 0; i < block; i++) {
            const double *pose = poses + 3 * (first + i);
            const double dx = pose[0] - f->x, dy = pose[1] - f->y;
            double c, s;
            cosine_sine(pose[2] - f->yaw, &c, &s);
            cosine[i] = (float)c, sine[i] = (float)s;
            x[i] = (float)((f->cosine * dx + f->sine * dy) / f->cell + 1.0);
            y[i] = (float)((f->cosine * dy - f->sine * dx) / f->cell + 1.0);
            sums[i] = 0;
        }
        for (int64_t b = 0; b < many; b++) {
            const float end_x = beams[b], end_y = beams[many + b];
            for (int i = 0; i < block; i++) {
                float u = x[i] + (cosine[i] * end_x - sine[i] * end_y), v = y[i] + (sine[i] * end_x + cosine[i] * end_y);
                u = u > 0.0f ? u : 0.0f;
                v = v > 0.0f ? v : 0.0f;
                u = u < last_u ? u : last_u;
                v = v < last_v ? v : last_v;
                cells[i] = (uint32_t)((int32_t)v * width + (int32_t)u);
            }
            for (int i = 0; i < block; i++)
                sums[i] += values[cells[i]];
        }
    }
}

/* Move each pose to a place near by where the beams are likeliest: a pattern search over the neighbours at a distance
   of `step` metres and `turn` radians, which are halved where no neighbour is better. */
void climb(const likelihoods *f, double *poses, int64_t count, const float *beams, int64_t many, double step,
           double turn, int64_t halvings, int64_t most, int64_t *sums)
{
    sum_poses(f, poses, count, beams, many, sums);
    for (int64_t i = 0; i < count; i++) {
        double reach = step, swing = turn, near[27][3];
        int64_t left = halvings, found[27];
        for (int64_t round = 0; round < most && left >= 0; round++) {
            for (int k = 0; k < 27; k++) {
                near[k][0] = poses[3 * i] + (k / 3 % 3 - 1) * reach;
                near[k][1] = poses[3 * i + 1] + (k % 3 - 1) * reach;
                near[k][2] = poses[3 * i + 2] + (k / 9 - 1) * swing;
            }
            sum_poses(f, near[0], 27, beams, many, found);
            const int64_t before = sums[i];
            for (int k = 0; k < 27; k++)
                if (found[k] > sums[i])
                    sums[i] = found[k], memcpy(poses + 3 * i, near[k], sizeof near[k]);
            if (sums[i] == before)
                left--, reach *= 0.5, swing *= 0.5;
        }
    }
}

/* The row of a bin in a hash table: its own, or the empty one where it belongs. The table has mask + 1 rows, a power
   of two, and at least one of them is empty. */
static inline int64_t find_bin(const int64_t *table, int64_t mask, int64_t bin)
{
    int64_t row = (int64_t)((uint64_t)bin * 0x9E3779B97F4A7C15u >> 32) & mask;
    while (table[row] != EMPTY && table[row] != bin)
        row = (row + 1) & mask;
    return row;
}

/* A pose's bin as a number: of steps along x, along y, and of its heading from 0 to a full turn. */
static inline int64_t bin_of(const double *pose, const double *size)
{
    const double turn = pose[2] - TAU * floor(pose[2] / TAU);
    const double steps[3] = {floor(pose[0] / size[0]), floor(pose[1] / size[1]), floor(turn / size[2])};
    /* What is not finite is in a bin too. */
    const int fits = fabs(steps[0]) < 1e8 && fabs(steps[1]) < 1e8 && fabs(steps[2]) < (double)STEP_Y;
    return fits ? (int64_t)steps[0] * STEP_X + (int64_t)steps[1] * STEP_Y + (int64_t)steps[2] : 0;
}

/* Draw particles by the running sums of their weights until they are enough for their bins; return how many.
   Where `strange` says so, the ith comes from row count + i of `poses`. */
int64_t resample(const double *poses, const double *sums, int64_t count, const double *draws, const uint8_t *strange,
                 int64_t most, const int64_t *enough, int64_t limits, const double *size, int64_t *table, int64_t mask,
                 int64_t *guide, double *out)
{
    /* For each part of the range of draws the first particle that it may mean: a search needs two steps from there. */
    for (int64_t k = 0, place = 0; k < count; k++) {
        while (place < count - 1 && sums[place] * (double)count <= (double)k)
            place++;
        guide[k] = place;
    }
    int64_t bins = 0;
    for (int64_t i = 0; i < most; i++) {
        int64_t chosen = count + i;
        if (!strange[i]) {
            const double draw = draws[i], part = draw * (double)count;
            chosen = guide[!(part < (double)count) ? count - 1 : part > 0.0 ? (int64_t)part : 0];
            while (chosen > 0 && sums[chosen - 1] > draw)
                chosen--;
            while (chosen < count - 1 && sums[chosen] <= draw)
                chosen++;
        }
        memcpy(out + 3 * i, poses + 3 * chosen, 3 * sizeof *out);
        const int64_t bin = bin_of(out + 3 * i, size), row = find_bin(table, mask, bin);
        bins += table[row] != bin;
        table[row] = bin;
        if (i + 1 >= enough[bins < limits ? bins : limits - 1])
            return i + 1;
    }
    return most;
}

/* Give particles whose bins touch, if only at a corner, the same label, and write the mean (3) and the covariance (3, 3)
   of the heaviest cluster. `turns` bins make a full turn: the last one touches the first. */
void find_cluster(const double *poses, const double *weights, int64_t count, const double *size, int64_t turns,
                  int64_t *table, int64_t mask, int64_t *cluster, int64_t *stack, double *totals, int64_t *labels,
                  double *mean, double *covariance)
{
    int64_t clusters = 0;
    for (int64_t i = 0; i < count; i++) {
        const int64_t bin = bin_of(poses + 3 * i, size);
        labels[i] = find_bin(table, mask, bin);
        table[labels[i]] = bin;
        cluster[labels[i]] = -1;
    }
    for (int64_t i = 0; i < count; i++) {
        if (cluster[labels[i]] < 0) {
            int64_t height = 1;
            stack[0] = labels[i], cluster[labels[i]] = clusters;
            while (height > 0) {
                const int64_t place = table[stack[--height]], turn = place & (STEP_Y - 1);
                for (int near = 0; near < 27; near++) {
                    const int64_t aside = (near / 9 - 1) * STEP_X + (near / 3 % 3 - 1) * STEP_Y;
                    const int64_t next = (turn + near % 3 - 1 + turns) % turns;
                    const int64_t row = find_bin(table, mask, place - turn + aside + next);
                    if (table[row] != EMPTY && cluster[row] < 0)
                        cluster[row] = clusters, stack[height++] = row;
                }
            }
            clusters++;
        }
        labels[i] = cluster[labels[i]];
        totals[labels[i]] += weights[i];
    }
    int64_t best = 0, about = -1;
    for (int64_t k = 1; k < clusters; k++)
        best = totals[k] > totals[best] ? k : best;
    for (int64_t i = 0; i < count; i++)
        if (labels[i] == best && (about < 0 || weights[i] > weights[about]))
            about = i;
    const double *q = poses + 3 * about;
    /* Of the weights times the products of 1, x, y and turn, counted from there. */
    double sums[16] = {0.0};
    for (int64_t i = 0; i < count; i++) {
        if (labels[i] != best)
            continue;
        const double *p = poses + 3 * i, turn = p[2] - q[2];
        const double terms[4] = {1.0, p[0] - q[0], p[1] - q[1], turn - TAU * rint(turn * (1.0 / TAU))};
        for (int k = 0; k < 16; k++)
            sums[k] += weights[i] * terms[k / 4] * terms[k % 4];
    }
    for (int k = 15; k >= 0; k--)
        sums[k] /= sums[0];
    for (int i = 0; i < 3; i++) {
        mean[i] = q[i] + sums[1 + i];
        for (int k = 0; k < 3; k++)
            covariance[3 * i + k] = sums[4 * (1 + i) + 1 + k] - sums[1 + i] * sums[1 + k];
    }
}
