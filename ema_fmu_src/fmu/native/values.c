/* An instance's values: getting and setting them, and the slopes of its inputs. */

#include <math.h>
#include <string.h>

#include "layout.h"

static const char *const KINDS[] = {"Real", "Integer", "Boolean", "String"};

static Outcome refuse_null(const Instance *m, int kind) {
    REFUSE("%s variables: the value references or the values are null", KINDS[kind]);
}

/* Refuses a reference that is of no variable of that kind. */
static Outcome refuse_reference(const Instance *m, int kind, Reference vr) {
    REFUSE("value reference %u is no %s variable of " MODEL, vr, KINDS[kind]);
}

/* Whether the references are of variables of that kind. */
static Outcome check_references(const Instance *m, int kind, const Reference vr[], size_t n, const void *value) {
    if (n && !(vr && value)) return refuse_null(m, kind);
    for (size_t i = 0; i < n; i++)
        if (vr[i] >= N_VARIABLES || KIND_OF[vr[i]] != kind) return refuse_reference(m, kind, vr[i]);
    return OK;
}

/* Logs why `value` may not be set. */
static Outcome refuse_value(const Instance *m, Reference vr, double value) {
    const Variable *variable = &VARIABLES[vr];
    const double kept = m->state.v[vr];
#define KEEP(outcome, ...) return instance_tell(m, outcome, "%s = %.15g refused: " __VA_ARGS__)
    if (!is_settable(variable)) KEEP(ERROR, "only the FMU sets it; it stays %.15g", variable->name, value, kept);
    if (!isfinite(value)) KEEP(DISCARDED, "a finite number is needed; it stays %.15g", variable->name, value, kept);
    if (value < variable->minimum)
        KEEP(DISCARDED, "it is less than the minimum %.15g; it stays %.15g", variable->name, value, variable->minimum, kept);
    if (value > variable->maximum)
        KEEP(DISCARDED, "it is more than the maximum %.15g; it stays %.15g", variable->name, value, variable->maximum, kept);
    KEEP(ERROR, "a fixed parameter cannot change after initialization; it stays %.15g", variable->name, value, kept);
}

static bool may_set(const State *s, Reference vr, double value) {
    const Variable *variable = &VARIABLES[vr];
    return is_settable(variable) && in_range(variable, value) && !(variable->fixed && s->mode == RUNNING);
}

static void set(State *s, Reference vr, double value) {
    s->v[vr] = value;
    s->fresh = 0;
    if (VARIABLES[vr].causality == PARAMETER) s->x[STALE] = 1.0;
}

/* How many of the n references follow one another from the first on; by eights, which a processor compares at once. */
static size_t following(const Reference vr[], size_t n) {
    size_t found = 0;
    for (; found + 8 <= n; found += 8) {
        Reference differ = 0;
        for (Reference i = 0; i < 8; i++) differ |= vr[found + i] ^ (vr[0] + (Reference)found + i);
        if (differ) break;
    }
    while (found < n && vr[found] == vr[0] + found) found++;
    return found;
}

/* Takes in what has been set, if the outputs are asked for while initializing. */
static Outcome refresh(Instance *m) {
    return m->state.mode == INITIALIZING && !m->state.fresh ? instance_initialize(m) : OK;
}

/* Outputs mostly follow one another; those that do are copied together. */
Outcome instance_get_double(Instance *m, const Reference vr[], size_t n, double value[]) {
    if (n && !(vr && value)) return refuse_null(m, REAL);
    const Outcome outcome = refresh(m);
    for (size_t i = 0; i < n;) {
        const Reference first = vr[i];
        if (first >= N_VARIABLES || KIND_OF[first] != REAL) return refuse_reference(m, REAL, first);
        const size_t run = following(vr + i, n - i < RUN_OF[first] ? n - i : RUN_OF[first]);
        memcpy(value + i, m->state.v + first, run * sizeof *value);
        i += run;
    }
    return outcome;
}

#define GET(name, kind, type)                                                                                      \
    Outcome instance_get_##name(Instance *m, const Reference vr[], size_t n, type value[]) {                       \
        if (n && !(vr && value)) return refuse_null(m, kind);                                                      \
        const Outcome outcome = refresh(m);                                                                        \
        for (size_t i = 0; i < n; i++) {                                                                           \
            if (vr[i] >= N_VARIABLES || KIND_OF[vr[i]] != kind) return refuse_reference(m, kind, vr[i]);           \
            value[i] = (type)m->state.v[vr[i]];                                                                    \
        }                                                                                                          \
        return outcome;                                                                                            \
    }

GET(int32, INTEGER, int32_t)
GET(flag, BOOLEAN, int)

/* `number` is what is kept of value[i]. */
#define SET(name, kind, type, number)                                                                              \
    Outcome instance_set_##name(Instance *m, const Reference vr[], size_t n, const type value[]) {                 \
        Outcome outcome = check_references(m, kind, vr, n, value);                                                 \
        if (outcome != OK) return outcome;                                                                         \
        for (size_t i = 0; i < n; i++) {                                                                           \
            if (may_set(&m->state, vr[i], number)) continue;                                                       \
            const Outcome refused = refuse_value(m, vr[i], number);                                                \
            if (refused > outcome) outcome = refused;                                                              \
        }                                                                                                          \
        for (size_t i = 0; i < n && outcome == OK; i++) set(&m->state, vr[i], number);                             \
        return outcome;                                                                                            \
    }

SET(double, REAL, double, value[i])
SET(int32, INTEGER, int32_t, value[i])
SET(flag, BOOLEAN, int, value[i] ? 1.0 : 0.0)

Outcome instance_use_string(const Instance *m, const Reference vr[], size_t n, const void *value) {
    return check_references(m, STRING, vr, n, value);
}

Outcome instance_set_slope(Instance *m, const Reference vr[], size_t n, const double value[]) {
    const Outcome outcome = check_references(m, REAL, vr, n, value);
    if (outcome != OK) return outcome;
    for (size_t i = 0; i < n; i++) {
        const char *name = VARIABLES[vr[i]].name;
        if (INPUT_OF[vr[i]] < 0) REFUSE("derivative of %s refused: it is no input", name);
        if (!isfinite(value[i])) REFUSE("derivative of %s refused: a finite number is needed", name);
    }
    for (size_t i = 0; i < n; i++) m->state.slope[INPUT_OF[vr[i]]] = value[i];
    m->state.ramps = 1;
    return OK;
}
