/* What an instance is made of: one block of memory, its state one plain struct in it, so that saving and restoring are
   copies. */

#ifndef LAYOUT_H
#define LAYOUT_H

#include <math.h>

#include "instance.h"
#include "twin.h"

typedef struct {
    double v[N_VARIABLES];
    double x[N_STATES];
    double slope[N_INPUTS];    /* of each input over the next step, per second; those in x are zero but within a step */
    double start, point, stop; /* experiment, and the last communication point [s] */
    double tolerance;
    int32_t mode;
    int32_t ramps;  /* an input has a slope */
    int32_t fresh;  /* while initializing: the outputs agree with what has been set */
    int32_t status; /* of the twin: index into STATUS */
    int32_t last;   /* outcome of the last step */
    int32_t unused; /* so that no byte of a state is left to chance */
} State;

struct Instance {
    State state;
    Host host;
    uint32_t logged; /* categories, a bit each */
    char name[];
};

#define REFUSE(...) return instance_tell(m, ERROR, __VA_ARGS__)

/* Takes in what has been set, while initializing. */
Outcome instance_initialize(Instance *m);

/* Whether the variable may have the value, at some time; the bounds of a Real that has none are the largest numbers. */
static inline bool in_range(const Variable *variable, double value) {
    return value >= variable->minimum && value <= variable->maximum;
}

/* Whether the host may set the variable, at some time. */
static inline bool is_settable(const Variable *variable) {
    return variable->causality == INPUT || variable->causality == PARAMETER;
}

#endif
