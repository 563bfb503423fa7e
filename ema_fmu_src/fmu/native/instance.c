/* An instance: its life, values and steps. What differs between the twins is in the generated twin.h and in the kernels. */

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "layout.h"

/* the kernels, emitted from Python; see ema_fmu_src/twins/__init__.py for the contract */
int ema_initialize(double *v, double *x);
int ema_advance(double *v, double *x, double t);

/* --- life and logging ----------------------------------------------------------------------------------------------- */

enum { ALL = (1 << N_CATEGORIES) - 1, PROBLEMS = 1 << logStatusDiscard | 1 << logStatusError | 1 << logStatusFatal };

static void tell(const Host *host, const char *name, uint32_t logged, Outcome outcome, const char *format, va_list values) {
    const int category = outcome == DISCARDED ? logStatusDiscard : logStatusError;
    if (!host->logger || !(logged & 1u << category)) return;
    char text[512];
    vsnprintf(text, sizeof text, format, values);
    host->log(host, name, outcome, CATEGORIES[category], text);
}

Outcome instance_tell(const Instance *m, Outcome outcome, const char *format, ...) {
    va_list values;
    va_start(values, format);
    tell(&m->host, m->name, m->logged, outcome, format, values);
    va_end(values);
    return outcome;
}

void host_tell(const Host *host, const char *name, const char *format, ...) {
    va_list values;
    va_start(values, format);
    tell(host, name && *name ? name : MODEL, PROBLEMS, ERROR, format, values);
    va_end(values);
}

static const char *mode_name(Mode mode) {
    switch (mode) {
    case INSTANTIATED: return "instantiated";
    case INITIALIZING: return "in initialization mode";
    case RUNNING: return "initialized";
    case TERMINATED: return "terminated";
    default: return "failed";
    }
}

Outcome instance_refuse_in_mode(const Instance *m, const char *function) {
    REFUSE("%s: not allowed while the instance is %s", function, mode_name(m->state.mode));
}

Outcome instance_choose_logged(Instance *m, bool on, size_t n, const char *const names[]) {
    uint32_t chosen = n ? 0 : ALL;
    if (n && !names) REFUSE("the log categories are null");
    for (size_t i = 0; i < n; i++) {
        int category = 0;
        while (category < N_CATEGORIES && (!names[i] || strcmp(names[i], CATEGORIES[category]) != 0)) category++;
        if (category == N_CATEGORIES) REFUSE("log categories refused: no category %s", names[i] ? names[i] : "(null)");
        chosen |= category == logAll ? ALL : 1u << category;
    }
    m->logged = on ? chosen : m->logged & ~chosen;
    return OK;
}

Instance *instance_create(const Host *host, const char *name, const char *identifier, const char *given, bool verbose) {
#define NO_INSTANCE(...) return host_tell(host, name, "no instance: " __VA_ARGS__), NULL
    if (!name || !*name) NO_INSTANCE("an instance name is needed");
    if (!given || strcmp(given, GUID) != 0)
        NO_INSTANCE("the %s %s is not this FMU's, %s", identifier, given ? given : "(null)", GUID);
    const size_t length = strlen(name) + 1;
    Instance *m = host->allocate(1, sizeof *m + length);
    if (!m) NO_INSTANCE("no memory");
    m->host = *host;
    m->logged = verbose ? ALL : PROBLEMS;
    memcpy(m->name, name, length);
    instance_reset(m);
    return m;
}

void instance_free(Instance *m) {
    if (m->host.release) m->host.release(m);
}

void instance_reset(Instance *m) {
    State *s = &m->state;
    memset(s, 0, sizeof *s);
    for (size_t i = 0; i < N_VARIABLES; i++) s->v[i] = VARIABLES[i].start;
    s->stop = INFINITY;
    s->mode = INSTANTIATED;
}

Outcome instance_set_experiment(Instance *m, const double *tolerance, double start, const double *stop) {
    if (!isfinite(start)) REFUSE("start time %g s refused: a finite number is needed", start);
    if (stop && !(*stop >= start)) REFUSE("stop time %g s refused: it is before the start time %g s", *stop, start);
    if (tolerance && !(isfinite(*tolerance) && *tolerance > 0.0))
        REFUSE("tolerance %g refused: a number above 0 is needed", *tolerance);
    m->state.start = m->state.point = start;
    m->state.stop = stop ? *stop : INFINITY;
    m->state.tolerance = tolerance ? *tolerance : 0.0;
    return OK;
}

static Outcome initialize(Instance *m) {
    State *s = &m->state;
    s->status = ema_initialize(s->v, s->x);
    s->x[TOLERANCE] = s->tolerance;
    s->fresh = 1;
    if (s->status) REFUSE(MODEL " cannot start: %s", STATUS[s->status]);
    return OK;
}

void instance_enter_initialization(Instance *m) { m->state.mode = INITIALIZING; }

Outcome instance_exit_initialization(Instance *m) {
    const Outcome outcome = initialize(m);
    m->state.mode = outcome == OK ? RUNNING : FAILED;
    return outcome;
}

void instance_terminate(Instance *m) { m->state.mode = TERMINATED; }

Mode instance_mode(const Instance *m) { return m->state.mode; }

/* --- values --------------------------------------------------------------------------------------------------------- */

static const char *const KINDS[] = {"Real", "Integer", "Boolean", "String"};

/* Whether the references are of variables of that kind. */
static Outcome check_references(const Instance *m, int kind, const Reference vr[], size_t n, const void *value) {
    if (n && !(vr && value)) REFUSE("%s variables: the value references or the values are null", KINDS[kind]);
    for (size_t i = 0; i < n; i++)
        if (vr[i] >= N_VARIABLES || KIND_OF[vr[i]] != kind)
            REFUSE("value reference %u is no %s variable of " MODEL, vr[i], KINDS[kind]);
    return OK;
}

/* Whether `value` may be set; logs why not. */
static Outcome check_value(const Instance *m, Reference vr, double value) {
    const Variable *variable = &VARIABLES[vr];
    const double kept = m->state.v[vr];
#define KEEP(...) REFUSE("%s = %.15g refused: " __VA_ARGS__)
    if (variable->causality != INPUT && variable->causality != PARAMETER)
        KEEP("only the FMU sets it; it stays %.15g", variable->name, value, kept);
    if (!isfinite(value)) KEEP("a finite number is needed; it stays %.15g", variable->name, value, kept);
    if (value < variable->minimum)
        KEEP("it is less than the minimum %.15g; it stays %.15g", variable->name, value, variable->minimum, kept);
    if (value > variable->maximum)
        KEEP("it is more than the maximum %.15g; it stays %.15g", variable->name, value, variable->maximum, kept);
    if (variable->fixed && m->state.mode == RUNNING)
        KEEP("a fixed parameter cannot change after initialization; it stays %.15g", variable->name, value, kept);
    return OK;
}

static void set(State *s, Reference vr, double value) {
    s->v[vr] = value;
    s->fresh = 0;
    if (VARIABLES[vr].causality == PARAMETER) s->x[STALE] = 1.0;
}

/* instance_get_NAME and instance_set_NAME: variables of a kind as values of a C type; `number` is what is kept of one. */
#define VALUES(name, kind, type, number)                                                                           \
    Outcome instance_get_##name(Instance *m, const Reference vr[], size_t n, type value[]) {                       \
        State *s = &m->state;                                                                                      \
        Outcome outcome = check_references(m, kind, vr, n, value);                                                 \
        if (outcome != OK) return outcome;                                                                         \
        if (s->mode == INITIALIZING && !s->fresh) outcome = initialize(m);                                         \
        for (size_t i = 0; i < n; i++) value[i] = (type)s->v[vr[i]];                                               \
        return outcome;                                                                                            \
    }                                                                                                              \
    Outcome instance_set_##name(Instance *m, const Reference vr[], size_t n, const type value[]) {                 \
        Outcome outcome = check_references(m, kind, vr, n, value);                                                 \
        if (outcome != OK) return outcome;                                                                         \
        for (size_t i = 0; i < n; i++)                                                                             \
            if (check_value(m, vr[i], number) != OK) outcome = ERROR;                                              \
        for (size_t i = 0; i < n && outcome == OK; i++) set(&m->state, vr[i], number);                             \
        return outcome;                                                                                            \
    }

VALUES(double, REAL, double, value[i])
VALUES(int32, INTEGER, int32_t, value[i])
VALUES(flag, BOOLEAN, int, value[i] ? 1.0 : 0.0)

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
    return OK;
}

/* --- steps ---------------------------------------------------------------------------------------------------------- */

/* How far from `time` another time may lie to count as the same [s]: hosts add up their steps. */
static double slack(double time) { return 1e-10 + 1e-9 * fabs(time); }

Outcome instance_step(Instance *m, double time, double step) {
    State *s = &m->state;
    const double end = time + step;
#define DISCARD(...)                                                                                               \
    return s->last = instance_tell(m, DISCARDED, "step from %.15g s over %.15g s discarded: " __VA_ARGS__)
    if (!(isfinite(time) && isfinite(step))) DISCARD("time and step must be finite", time, step);
    if (step <= 0.0) DISCARD("a step of more than 0 s is needed", time, step);
    if (fabs(time - s->point) > slack(s->point))
        DISCARD("it does not follow the last communication point, %.15g s", time, step, s->point);
    if (end <= s->point)
        DISCARD("it is too short: it would end at %.15g s, and the FMU is at %.15g s", time, step, end, s->point);
    if (end > s->stop + slack(s->stop))
        DISCARD("it would end at %.15g s, after the stop time %.15g s", time, step, end, s->stop);
    for (size_t i = 0; i < N_INPUTS; i++) s->x[SLOPE_OF[i]] = s->slope[i];
    s->status = ema_advance(s->v, s->x, end - s->start);
    memset(s->slope, 0, sizeof s->slope);
    if (s->status) {
        s->mode = FAILED;
        s->last = ERROR;
        REFUSE("step from %.15g s over %.15g s failed: %s", time, step, STATUS[s->status]);
    }
    s->point = end;
    return s->last = OK;
}

Outcome instance_last_outcome(const Instance *m) { return m->state.last; }

double instance_time(const Instance *m) { return m->state.point; }
