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
    double slope[N_INPUTS];    /* of each input over the next step, per second */
    double start, point, stop; /* experiment, and the last communication point [s] */
    double tolerance;          /* 0: none given */
    int32_t mode;
    int32_t fresh;  /* while initializing: the outputs agree with what has been set */
    int32_t status; /* of the twin: index into STATUS */
    int32_t last;   /* outcome of the last step */
} State;

struct Instance {
    State state;
    Host host;
    uint32_t logged; /* categories, a bit each */
    char name[];
};

#define REFUSE(...) return instance_tell(m, ERROR, __VA_ARGS__)

#endif
