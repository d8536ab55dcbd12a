/* Localisation: how well scans fit a map, which particles are drawn, and which belong together.
   A field holds what a beam that ends in a cell is worth (zteam.planning.likelihood); what is outside of it counts as
   its border. All is in cells of the field. Whole numbers add to the same sum in any order. */
#include "kernels.h"

#include "sines.h"

enum { BLOCK = 256 };
#define EMPTY INT64_MIN /* no bin, in a hash table */
/* A bin's number: floor(x) * 2^34 + floor(y) * 2^6 + turn (zteam.planning.particles). */
#define STEP_X ((uint64_t)1 << 34)
#define STEP_Y ((uint64_t)1 << 6)

/* Write the sum of the field's values where the beams of each pose (x, y, yaw) end.
   One beam of all poses of a block after the other: where they end lies together in memory. Seven digits are a
   thousandth of a cell on a map of 10 000 cells. */
void sum_poses(const uint16_t *values, int64_t rows, int64_t columns, const double *poses, int64_t count,
               const double *beams_x, const double *beams_y, int64_t beams, int32_t *out)
{
    const float last_u = (float)(columns - 1), last_v = (float)(rows - 1);
    const int32_t width = (int32_t)columns;
    for (int64_t first = 0; first < count; first += BLOCK) {
        float x[BLOCK], y[BLOCK], c[BLOCK], s[BLOCK];
        int32_t cells[BLOCK], sums[BLOCK];
        const int many = count - first < BLOCK ? (int)(count - first) : BLOCK;
        for (int i = 0; i < many; i++) {
            double cosine, sine;
            cosine_sine(poses[3 * (first + i) + 2], &cosine, &sine);
            x[i] = (float)poses[3 * (first + i)], y[i] = (float)poses[3 * (first + i) + 1];
            c[i] = (float)cosine, s[i] = (float)sine;
            sums[i] = 0;
        }
        for (int64_t b = 0; b < beams; b++) {
            const float beam_x = (float)beams_x[b], beam_y = (float)beams_y[b];
            for (int i = 0; i < many; i++) {
                float u = x[i] + (c[i] * beam_x - s[i] * beam_y), v = y[i] + (s[i] * beam_x + c[i] * beam_y);
                u = u > 0.0f ? u : 0.0f;
                v = v > 0.0f ? v : 0.0f;
                u = u < last_u ? u : last_u;
                v = v < last_v ? v : last_v;
                cells[i] = (int32_t)v * width + (int32_t)u;
            }
            for (int i = 0; i < many; i++)
                sums[i] += values[(uint32_t)cells[i]];
        }
        for (int i = 0; i < many; i++)
            out[first + i] = sums[i];
    }
}

/* Sum of the field's values where the beams of one pose end, with all digits. */
static int64_t sum_pose(const uint16_t *values, int64_t rows, int64_t columns, double x, double y, double cosine,
                        double sine, const double *beams_x, const double *beams_y, int64_t beams)
{
    const double last_u = (double)(columns - 1), last_v = (double)(rows - 1);
    const int32_t width = (int32_t)columns;
    int64_t sum = 0;
    for (int64_t first = 0; first < beams; first += BLOCK) {
        int32_t cells[BLOCK];
        const int many = beams - first < BLOCK ? (int)(beams - first) : BLOCK;
        for (int i = 0; i < many; i++) {
            double u = x + (cosine * beams_x[first + i] - sine * beams_y[first + i]);
            double v = y + (sine * beams_x[first + i] + cosine * beams_y[first + i]);
            u = u > 0.0 ? u : 0.0;
            v = v > 0.0 ? v : 0.0;
            u = u < last_u ? u : last_u;
            v = v < last_v ? v : last_v;
            cells[i] = (int32_t)v * width + (int32_t)u;
        }
        for (int i = 0; i < many; i++)
            sum += values[(uint32_t)cells[i]];
    }
    return sum;
}

/* Move each pose to a place near by where the beams are likeliest: a pattern search over the 26 neighbours at a
   distance of `step` cells and `turn` radians, which are halved where no neighbour is better. */
void climb(const uint16_t *values, int64_t rows, int64_t columns, double *poses, int64_t count, const double *beams_x,
           const double *beams_y, int64_t beams, double step, double turn, int64_t halvings, int64_t most,
           int64_t *sums)
{
    for (int64_t i = 0; i < count; i++) {
        double *pose = poses + 3 * i, reach = step, swing = turn, cosine, sine;
        int64_t left = halvings;
        cosine_sine(pose[2], &cosine, &sine);
        sums[i] = sum_pose(values, rows, columns, pose[0], pose[1], cosine, sine, beams_x, beams_y, beams);
        for (int64_t round = 0; round < most && left >= 0; round++) {
            const double x = pose[0], y = pose[1], yaw = pose[2];
            const int64_t before = sums[i];
            for (int place = 0; place < 27; place++) {
                const double u = x + (place / 3 % 3 - 1) * reach, v = y + (place % 3 - 1) * reach;
                const double angle = yaw + (place / 9 - 1) * swing;
                if (place % 9 == 0)
                    cosine_sine(angle, &cosine, &sine);
                int64_t sum = sum_pose(values, rows, columns, u, v, cosine, sine, beams_x, beams_y, beams);
                if (sum > sums[i])
                    sums[i] = sum, pose[0] = u, pose[1] = v, pose[2] = angle;
            }
            if (sums[i] == before)
                left--, reach *= 0.5, swing *= 0.5;
        }
    }
}

/* The row of a bin in a hash table: its own, or the empty one where it belongs. The table has mask + 1 rows, a power
   of two, and at least one of them is empty. */
static int64_t find_bin(const int64_t *table, int64_t mask, int64_t bin)
{
    int64_t row = (int64_t)((uint64_t)bin * 0x9E3779B97F4A7C15u >> 32) & mask;
    while (table[row] != EMPTY && table[row] != bin)
        row = (row + 1) & mask;
    return row;
}

/* Draw particles by the running sums of their weights until they are enough for their bins; return how many.
   `chosen` become their numbers; that of the ith is count + i where it is a stranger. */
int64_t resample(const double *sums, int64_t count, const double *draws, const uint8_t *strange, int64_t most,
                 const int64_t *bins, const int64_t *enough, int64_t limits, int64_t *table, int64_t mask,
                 int64_t *guide, int64_t *chosen)
{
    /* For each part of the range of draws the first particle that it may mean: a search needs two steps from there. */
    for (int64_t k = 0, place = 0; k < count; k++) {
        while (place < count - 1 && sums[place] * (double)count <= (double)k)
            place++;
        guide[k] = place;
    }
    int64_t found = 0;
    for (int64_t i = 0; i < most; i++) {
        chosen[i] = count + i;
        if (!strange[i]) {
            const double draw = draws[i], part = draw * (double)count;
            int64_t low = guide[!(part < (double)count) ? count - 1 : part > 0.0 ? (int64_t)part : 0];
            while (low > 0 && sums[low - 1] > draw)
                low--;
            while (low < count - 1 && sums[low] <= draw)
                low++;
            chosen[i] = low;
        }
        const int64_t bin = bins[chosen[i]], row = find_bin(table, mask, bin);
        found += table[row] != bin;
        table[row] = bin;
        if (i + 1 >= enough[found < limits ? found : limits - 1])
            return i + 1;
    }
    return most;
}

/* Give particles whose bins touch, if only at a corner, the same label; return how many labels there are.
   `turns` bins make a full turn: the last one touches the first. */
int64_t label_clusters(const int64_t *bins, int64_t count, int64_t turns, int64_t *table, int64_t mask,
                       int64_t *cluster, int64_t *stack, int64_t *labels)
{
    int64_t clusters = 0;
    for (int64_t i = 0; i < count; i++) {
        labels[i] = find_bin(table, mask, bins[i]);
        table[labels[i]] = bins[i];
        cluster[labels[i]] = -1;
    }
    for (int64_t i = 0; i < count; i++) {
        if (cluster[labels[i]] < 0) {
            int64_t height = 1;
            stack[0] = labels[i];
            cluster[labels[i]] = clusters;
            while (height > 0) {
                const uint64_t place = (uint64_t)table[stack[--height]], turn = place % STEP_Y;
                for (int near = 0; near < 27; near++) {
                    const uint64_t next = (turn + (uint64_t)(near % 3 - 1 + turns)) % (uint64_t)turns;
                    const uint64_t other = place - turn + (uint64_t)(near / 9 - 1) * STEP_X
                        + (uint64_t)(near / 3 % 3 - 1) * STEP_Y + next;
                    const int64_t row = find_bin(table, mask, (int64_t)other);
                    if (table[row] != EMPTY && cluster[row] < 0) {
                        cluster[row] = clusters;
                        stack[height++] = row;
                    }
                }
            }
            clusters++;
        }
        labels[i] = cluster[labels[i]];
    }
    return clusters;
}
