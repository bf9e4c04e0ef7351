/* Predicts with an exported model. For a model of a pendulum:

       cc -include pendulum.h '-DMODEL(name)=pendulum_##name' -DJOINTS=PENDULUM_JOINTS -DSTATES=PENDULUM_STATES c.c -lm

   Reads numbers: how many points and steps there are, the length of a step, state and torque of each point, a start,
   the torque of each step from there. Prints a line for each point, the state after a step and the derivative, and a
   line for each step, the state. */

#include <stdio.h>
#include <stdlib.h>

static void get(MODEL(real) *numbers, int count)
{
    int i;
    for (i = 0; i < count; i++) {
        double number;
        if (scanf("%lf", &number) != 1) {
            fputs("a number is missing\n", stderr);
            exit(EXIT_FAILURE);
        }
        numbers[i] = (MODEL(real))number;
    }
}

static void put(const MODEL(real) *numbers)
{
    int i;
    for (i = 0; i < STATES; i++)
        printf("%.17g ", (double)numbers[i]);
}

int main(void)
{
    const MODEL(parameters) parameters = MODEL(defaults)();
    MODEL(memory) memory;
    MODEL(real) step, state[STATES], torque[JOINTS], rates[STATES];
    int points, steps, k;
    if (scanf("%d %d", &points, &steps) != 2)
        return EXIT_FAILURE;
    get(&step, 1);
    for (k = 0; k < points; k++) {
        get(state, STATES);
        get(torque, JOINTS);
        MODEL(derivative)(&parameters, state, torque, 0, rates);
        MODEL(reset)(&memory);
        MODEL(step)(&parameters, &memory, state, torque, 0, step);
        put(state);
        put(rates);
        puts("");
    }
    get(state, STATES);
    MODEL(reset)(&memory);
    for (k = 0; k < steps; k++) {
        get(torque, JOINTS);
        MODEL(step)(&parameters, &memory, state, torque, (MODEL(real))k * step, step);
        put(state);
        puts("");
    }
    return EXIT_SUCCESS;
}
