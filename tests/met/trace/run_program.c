/* Runs the program that was included before, of the names INPUTS, OUTPUTS, COLUMNS, DIVISOR, for each case that is given:
   its inputs and its last tick, as doubles; answers its rows and its outputs. */

#include "bare.h"

static int run(void)
{
    double given[INPUTS + 1];
    while (take(given, sizeof given)) {
        put_inputs(given);
        met_start(&now);
        for (int64_t k = 0; (double)k <= given[INPUTS]; k++) {
            met_tick(&now, k);
            if (k % DIVISOR == 0 && !give(now.row, sizeof now.row)) return 1;
        }
        met_end(&now);
        double outputs[OUTPUTS];
        get_outputs(outputs);
        if (!give(outputs, sizeof outputs)) return 1;
    }
    return 0;
}
