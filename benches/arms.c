/* The dynamics of an arm of seven joints by MuJoCo and by the header that `residyn export --format c` writes, one state at a
 * time on one core. arms MJCF prints one JSON object a measurement; benches/arms compiles and runs it. */
#include <stdio.h>
#include <time.h>
#include <mujoco/mujoco.h>
#include "arm.h"

enum { STATES = 200000, REPEATS = 7, N = 7 };

static mjModel *m;
static mjData *d;
static arm_parameters parameters;

static double value(int k, int round) { return 0.3 + 0.1 * k + 1e-6 * round; }

static void set(int round)
{
    for (int j = 0; j < N; j++) {
        d->qpos[j] = value(j, round), d->qvel[j] = value(N + j, round);
        d->qacc[j] = d->ctrl[j] = value(2 * N + j, round);
    }
}

static double mujoco_inverse(int round) { set(round); mj_inverse(m, d); return d->qfrc_inverse[0]; }
static double mujoco_forward(int round) { set(round); mj_forward(m, d); return d->qacc[0]; }

static double own(int round, int forward)
{
    double state[2 * N], driving[N], result[2 * N], none[N] = {0};
    for (int j = 0; j < N; j++)
        state[j] = value(j, round), state[N + j] = value(N + j, round), driving[j] = value(2 * N + j, round);
    if (forward)
        arm_derivative(&parameters, state, driving, 0, result);
    else
        arm_inverse_dynamics(&parameters, state, driving, none, 0, result);
    return result[forward ? N : 0];
}

static double own_inverse(int round) { return own(round, 0); }
static double own_forward(int round) { return own(round, 1); }

static void measure(const char *who, const char *what, double (*work)(int))
{
    double best = 1e300, sum = 0;
    for (int repeat = 0; repeat < REPEATS; repeat++) {
        struct timespec begun, ended;
        clock_gettime(CLOCK_MONOTONIC, &begun);
        for (int round = 0; round < STATES; round++)
            sum += work(round);
        clock_gettime(CLOCK_MONOTONIC, &ended);
        const double taken = 1e9 * (ended.tv_sec - begun.tv_sec) + (ended.tv_nsec - begun.tv_nsec);
        best = taken / STATES < best ? taken / STATES : best;
    }
    printf("{\"who\": \"%s\", \"what\": \"%s\", \"ns\": %.1f, \"sum\": %g}\n", who, what, best, sum);
}

int main(int count, char **arguments)
{
    char error[1000] = "no file";
    m = count > 1 ? mj_loadXML(arguments[1], NULL, error, sizeof error) : NULL;
    if (!m)
        return fprintf(stderr, "%s\n", error), 1;
    d = mj_makeData(m);
    parameters = arm_defaults();
    measure("MuJoCo", "inverse", mujoco_inverse);
    measure("MuJoCo", "forward", mujoco_forward);
    measure("residyn, C header", "inverse", own_inverse);
    measure("residyn, C header", "forward", own_forward);
}
