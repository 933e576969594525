/* Self-test of @NAME@: reference values from Python, one line of outcome, exit status 0 if all agree. */
#include "@NAME@.h"

#include <math.h>
#include <stdio.h>

#define ROWS @ROWS@
#define COLUMNS (@NAME_UPPER@_OUTPUTS + 3)

/* eps, deps, P, dP */
static const double inputs[ROWS][4] = {
@INPUT_ROWS@
};

/* predictions, then V, dV/deps, dV/dP */
static const double expected[ROWS][COLUMNS] = {
@EXPECTED_ROWS@
};

/* largest deviation of each column that passes */
static const double tolerance[COLUMNS] = {@TOLERANCES@};

int main(void)
{
    static const char *const names[COLUMNS] = {@COLUMN_NAMES@};
    int row, k, failed = 0;@PATH@
    for (row = 0; row < ROWS; row++) {
@TAKE@        @NAME@_real y[COLUMNS];
        @NAME@_jet jet;
        @NAME@_predict(&s, y, &jet);
        y[@NAME_UPPER@_OUTPUTS] = jet.V;
        y[@NAME_UPPER@_OUTPUTS + 1] = jet.V_eps;
        y[@NAME_UPPER@_OUTPUTS + 2] = jet.V_P;
        for (k = 0; k < COLUMNS; k++)
            if (!(fabs((double)y[k] - expected[row][k]) <= tolerance[k])) {
                printf("row %d: %s is %.17g, expected %.17g within %.3g\n", row, names[k], (double)y[k],
                       expected[row][k], tolerance[k]);
                failed = 1;
            }
    }
    printf("@NAME@: %s, %d rows of %d numbers\n", failed ? "FAILED" : "passed", ROWS, COLUMNS);
    return failed;
}
