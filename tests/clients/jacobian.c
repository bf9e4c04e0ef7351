/* The Jacobians of an exported model beside central differences, compiled and asked as docs/clients/c.c is. Prints for
   each point the largest difference of the derivative's and of the step's, relative to 1 and each row's largest entry. */

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { COLUMNS = STATES + JOINTS };

static const MODEL(real) NUDGE = 1e-6;

static void get(MODEL(real) *numbers, int count)
{
    int i;
    for (i = 0; i < count; i++)
        if (scanf("%lf", &numbers[i]) != 1)
            exit(EXIT_FAILURE);
}

/* A memory in which the torque was held for so long that it acts. */
static MODEL(memory) settled(const MODEL(parameters) *parameters, const MODEL(real) *torque)
{
    MODEL(memory) memory;
    MODEL(real) acting[64][JOINTS];
    int k;
    MODEL(reset)(&memory);
    for (k = 0; k < 1000; k++)
        MODEL(acting)(parameters, &memory, torque, 0.01, acting);
    return memory;
}

static void rates(const MODEL(real) *at, MODEL(real) step, MODEL(real) *to)
{
    const MODEL(parameters) parameters = MODEL(defaults)();
    (void)step;
    MODEL(derivative)(&parameters, at, at + STATES, 0.3, to);
}

static void next(const MODEL(real) *at, MODEL(real) step, MODEL(real) *to)
{
    const MODEL(parameters) parameters = MODEL(defaults)();
    MODEL(memory) memory = settled(&parameters, at + STATES);
    int i;
    for (i = 0; i < STATES; i++)
        to[i] = at[i];
    MODEL(step)(&parameters, &memory, to, at + STATES, 0.3, step);
}

static double difference(void (*function)(const MODEL(real) *, MODEL(real), MODEL(real) *), MODEL(real) at[COLUMNS],
                         MODEL(real) step, MODEL(real) by_state[STATES][STATES], MODEL(real) by_torque[STATES][JOINTS])
{
    double scale[STATES], worst = 0;
    int i, c;
    for (i = 0; i < STATES; i++) {
        scale[i] = 1;
        for (c = 0; c < COLUMNS; c++)
            scale[i] = fmax(scale[i], fabs(c < STATES ? by_state[i][c] : by_torque[i][c - STATES]));
    }
    for (c = 0; c < COLUMNS; c++) {
        /* Five points: the curvature of a contact shows in three. */
        MODEL(real) moved[4][STATES];
        const MODEL(real) here = at[c];
        const int by[4] = {1, -1, 2, -2};
        int k;
        for (k = 0; k < 4; k++) {
            at[c] = here + by[k] * NUDGE;
            function(at, step, moved[k]);
        }
        at[c] = here;
        for (i = 0; i < STATES; i++) {
            const double entry = c < STATES ? by_state[i][c] : by_torque[i][c - STATES];
            const double near = moved[0][i] - moved[1][i], far = moved[2][i] - moved[3][i];
            const double off = fabs((8 * near - far) / (12 * NUDGE) - entry) / scale[i];
            worst = off <= worst ? worst : off;
        }
    }
    return worst;
}

int main(void)
{
    const MODEL(parameters) parameters = MODEL(defaults)();
    MODEL(real) step, at[COLUMNS], by_state[STATES][STATES], by_torque[STATES][JOINTS];
    int points, steps, k, i;
    if (scanf("%d %d", &points, &steps) != 2)
        return EXIT_FAILURE;
    get(&step, 1);
    for (k = 0; k < points; k++) {
        MODEL(real) state[STATES], plain[STATES];
        MODEL(memory) memory;
        get(at, COLUMNS);
        MODEL(derivative_jacobian)(&parameters, at, at + STATES, 0.3, by_state, by_torque);
        printf("%.17g ", difference(rates, at, step, by_state, by_torque));
        for (i = 0; i < STATES; i++)
            state[i] = at[i];
        memory = settled(&parameters, at + STATES);
        MODEL(step_jacobian)(&parameters, &memory, state, at + STATES, 0.3, step, by_state, by_torque);
        printf("%.17g ", difference(next, at, step, by_state, by_torque));
        next(at, step, plain);
        for (i = 0; i < STATES; i++)
            if (!(fabs(plain[i] - state[i]) <= 1e-12 * (1 + fabs(plain[i]))))
                return EXIT_FAILURE;
        puts("");
    }
    return EXIT_SUCCESS;
}
