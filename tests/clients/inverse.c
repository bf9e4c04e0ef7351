/* Inverse dynamics, compiled as docs/clients/c.c is. Reads how many motions there are, then for each state, acceleration and
   torque; prints the torques needed. */

#include <stdio.h>
#include <stdlib.h>

static int read(MODEL(real) *numbers, int count)
{
    double number;
    int k;
    for (k = 0; k < count; k++) {
        if (scanf("%lf", &number) != 1)
            return 0;
        numbers[k] = (MODEL(real))number;
    }
    return 1;
}

int main(void)
{
    const MODEL(parameters) parameters = MODEL(defaults)();
    MODEL(real) state[STATES], acceleration[JOINTS], torque[JOINTS], needed[JOINTS];
    int motions, k, j;
    if (scanf("%d", &motions) != 1)
        return EXIT_FAILURE;
    for (k = 0; k < motions; k++) {
        if (!read(state, STATES) || !read(acceleration, JOINTS) || !read(torque, JOINTS))
            return EXIT_FAILURE;
        MODEL(inverse_dynamics)(&parameters, state, acceleration, torque, 0, needed);
        for (j = 0; j < JOINTS; j++)
            printf("%.17g ", (double)needed[j]);
        puts("");
    }
    return EXIT_SUCCESS;
}
