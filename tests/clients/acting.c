/* The torques that act, compiled as docs/clients/c.c is. Reads how many steps there are, then for each its length and
   the torque commanded; prints the means over each of its parts. */

#include <stdio.h>
#include <stdlib.h>

int main(void)
{
    const MODEL(parameters) parameters = MODEL(defaults)();
    MODEL(memory) memory;
    MODEL(real) step, torque[JOINTS], acting[PARTS][JOINTS];
    int steps, k, part, j;
    MODEL(reset)(&memory);
    if (scanf("%d", &steps) != 1)
        return EXIT_FAILURE;
    for (k = 0; k < steps; k++) {
        if (scanf("%lf", &step) != 1)
            return EXIT_FAILURE;
        for (j = 0; j < JOINTS; j++)
            if (scanf("%lf", &torque[j]) != 1)
                return EXIT_FAILURE;
        MODEL(acting)(&parameters, &memory, torque, step, acting);
        for (part = 0; part < PARTS; part++)
            for (j = 0; j < JOINTS; j++)
                printf("%.17g ", (double)acting[part][j]);
        puts("");
    }
    return EXIT_SUCCESS;
}
