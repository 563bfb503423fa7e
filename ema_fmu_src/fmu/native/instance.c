/* An instance: its life and its steps. What differs between the twins is in the generated twin.h and in the kernels. */

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
    s->tolerance = DEFAULT_TOLERANCE;
    s->mode = INSTANTIATED;
}

Outcome instance_set_experiment(Instance *m, const double *tolerance, double start, const double *stop) {
    if (!isfinite(start)) REFUSE("start time %g s refused: a finite number is needed", start);
    if (stop && !(*stop >= start)) REFUSE("stop time %g s refused: it is before the start time %g s", *stop, start);
    if (tolerance && !(isfinite(*tolerance) && *tolerance > 0.0))
        REFUSE("tolerance %g refused: a number above 0 is needed", *tolerance);
    m->state.start = m->state.point = start;
    m->state.stop = stop ? *stop : INFINITY;
    m->state.tolerance = tolerance ? *tolerance : DEFAULT_TOLERANCE;
    return OK;
}

Outcome instance_initialize(Instance *m) {
    State *s = &m->state;
    s->status = ema_initialize(s->v, s->x);
    s->x[TOLERANCE] = s->tolerance;
    s->fresh = 1;
    if (s->status) REFUSE(MODEL " cannot start: %s", STATUS[s->status]);
    return OK;
}

void instance_enter_initialization(Instance *m) { m->state.mode = INITIALIZING; }

Outcome instance_exit_initialization(Instance *m) {
    const Outcome outcome = instance_initialize(m);
    m->state.mode = outcome == OK ? RUNNING : FAILED;
    return outcome;
}

void instance_terminate(Instance *m) { m->state.mode = TERMINATED; }

Mode instance_mode(const Instance *m) { return m->state.mode; }

/* --- steps ---------------------------------------------------------------------------------------------------------- */

static const double MOST_STEPS = 1e9; /* of the twin's own in one communication step: minutes of work */

/* How far from the last communication point, at `time`, a step may begin [s]: a thousandth of it, and what the host's clock
   rounds off, be it of double or of single precision. A tenth of a step is never rounding. */
static double slack(double time, double step) {
    const double single = 0x1p-23 * fabs(time), most = 0.1 * step;
    return 1e-3 * step + (single < most ? single : most) + 0x1p-50 * fabs(time);
}

/* An input that its slope takes out of its range within a step, by more than rounding; NULL if there is none. */
static const Variable *ramped_beyond(const State *s, double step) {
    for (size_t i = 0; i < N_INPUTS; i++) {
        if (s->slope[i] == 0.0) continue;
        const Variable *input = &VARIABLES[INPUTS[i]];
        const double end = s->v[INPUTS[i]] + s->slope[i] * step, rounding = 1e-9 * (input->maximum - input->minimum);
        if (end < input->minimum - rounding || end > input->maximum + rounding) return input;
    }
    return NULL;
}

Outcome instance_step(Instance *m, double time, double step) {
    State *s = &m->state;
    const double end = time + step, inner = s->x[CLOCK_STEP];
#define REFUSE_STEP(...)                                                                                           \
    return s->last = instance_tell(m, ERROR, "step from %.15g s over %.15g s refused: " __VA_ARGS__)
    if (!(isfinite(time) && isfinite(end))) REFUSE_STEP("time and step must be finite", time, step);
    if (step <= 0.0) REFUSE_STEP("a step of more than 0 s is needed", time, step);
    if (fabs(time - s->point) > slack(s->point, step))
        REFUSE_STEP("it does not follow the last communication point, %.15g s", time, step, s->point);
    if (end <= s->point)
        REFUSE_STEP("it is too short: it would end at %.15g s, and the FMU is at %.15g s", time, step, end, s->point);
    if (end > s->stop && end > s->stop + slack(s->stop, step))
        REFUSE_STEP("it would end at %.15g s, after the stop time %.15g s", time, step, end, s->stop);
    if (step > MOST_STEPS * inner)
        REFUSE_STEP("it takes %.6g steps of %.6g s within the FMU, and %.6g are the most", time, step, step / inner, inner,
                    MOST_STEPS);
    if (s->ramps) {
        const Variable *beyond = ramped_beyond(s, step);
        if (beyond)
            REFUSE_STEP("%s would ramp out of its range, %.15g to %.15g", time, step, beyond->name, beyond->minimum,
                        beyond->maximum);
        for (size_t i = 0; i < N_INPUTS; i++) s->x[SLOPE_OF[i]] = s->slope[i];
    }
    s->status = ema_advance(s->v, s->x, end - s->start);
    if (s->ramps) {
        for (size_t i = 0; i < N_INPUTS; i++) s->x[SLOPE_OF[i]] = 0.0;
        memset(s->slope, 0, sizeof s->slope);
        s->ramps = 0;
    }
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
