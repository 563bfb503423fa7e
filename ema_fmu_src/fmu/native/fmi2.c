/* The FMI 2.0 co-simulation API around a twin's kernels.

   Generic: everything that differs between the twins is in the generated twin.h. An instance is one block of memory, its
   state one plain struct in it, so that the state's get, set and serialise are copies; nothing is global but constants, so
   any number of instances run in any number of threads.

   What the host does wrong is refused with a message and a status, and changes nothing: a value or a call with fmi2Error, a
   step with fmi2Discard. The instance works on after either. A twin that has failed (fmi2Error from fmi2DoStep or
   fmi2ExitInitializationMode) takes fmi2Reset, fmi2SetFMUstate and fmi2FreeInstance, and its outputs can be read. */

#include <math.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"
#include "twin.h"

/* the kernels, emitted from Python; see ema_fmu_src/twins/__init__.py for the contract */
int ema_initialize(double *v, double *x);
int ema_advance(double *v, double *x, double t);

/* ---------------------------------------------------------------------------------------------------------- instance */

enum { /* modes: where an instance is in its life (FMI 2.0.4, section 4.2.4) */
    INSTANTIATED = 1,
    INITIALIZING = 2,
    RUNNING = 4, /* the standard's stepComplete; a refused step leaves it, for nothing has moved */
    TERMINATED = 8,
    FAILED = 16, /* the standard's error */
    ANY = 31
};

typedef struct {
    double v[N_VARIABLES];
    double x[N_STATES];
    double slope[N_INPUTS]; /* of each input over the next step, per second */
    double start, point, stop; /* experiment, and the last communication point [s] */
    double tolerance;          /* 0: none given */
    int32_t mode;
    int32_t fresh;  /* while initializing: the outputs agree with what has been set */
    int32_t status; /* of the twin: index into STATUS */
    int32_t last;   /* what the last fmi2DoStep returned */
} State;

typedef struct {
    State state;
    fmi2CallbackFunctions host;
    uint32_t logged; /* categories, a bit each */
    char name[];
} Instance;

enum { WARNING = 1, DISCARDED = 2, ERROR = 4, FATAL = 8, ALL = 16 };

static const struct {
    const char *name;
    uint32_t bits;
} CATEGORIES[] = {
    {"logStatusWarning", WARNING}, {"logStatusDiscard", DISCARDED}, {"logStatusError", ERROR},
    {"logStatusFatal", FATAL},     {"logAll", ALL | 15},
};
enum { N_CATEGORIES = sizeof CATEGORIES / sizeof *CATEGORIES, PROBLEMS = DISCARDED | ERROR | FATAL };

#if defined __GNUC__
__attribute__((format(printf, 6, 7)))
#endif
static fmi2Status tell(const fmi2CallbackFunctions *host, const char *name, uint32_t logged, uint32_t category,
                       fmi2Status status, const char *format, ...) {
    if (host && host->logger && logged & category) {
        char text[512];
        va_list values;
        va_start(values, format);
        vsnprintf(text, sizeof text, format, values);
        va_end(values);
        for (char *c = text; *c; c++)
            if (*c == '%') *c = '#'; /* hosts pass the message to printf */
        host->logger(host->componentEnvironment, name, status,
                     category == DISCARDED ? "logStatusDiscard" : "logStatusError", text);
    }
    return status;
}

#define REFUSE(...) return tell(&m->host, m->name, m->logged, ERROR, fmi2Error, __VA_ARGS__)
#define DISCARD(...) return m->state.last = tell(&m->host, m->name, m->logged, DISCARDED, fmi2Discard, __VA_ARGS__)

static const char *mode_name(int32_t mode) {
    switch (mode) {
    case INSTANTIATED: return "instantiated";
    case INITIALIZING: return "in initialization mode";
    case RUNNING: return "initialized";
    case TERMINATED: return "terminated";
    default: return "failed";
    }
}

/* Opens every function: the instance `m`, refused where there is none or the standard does not allow the call. */
#define INSTANCE(function, modes)                                                                                  \
    Instance *m = c;                                                                                               \
    if (!m) return fmi2Error;                                                                                      \
    if (!(m->state.mode & (modes)))                                                                                \
        REFUSE(function ": not allowed while the instance is %s", mode_name(m->state.mode))

/* ------------------------------------------------------------------------------------------------- life and logging */

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }

const char *fmi2GetVersion(void) { return fmi2Version; }

static void restart(State *s) {
    memset(s, 0, sizeof *s);
    for (size_t i = 0; i < N_VARIABLES; i++) s->v[i] = VARIABLES[i].start;
    s->stop = INFINITY;
    s->mode = INSTANTIATED;
}

static void *allocate(const fmi2CallbackFunctions *host, size_t size) {
    return host->allocateMemory ? host->allocateMemory(1, size) : calloc(1, size);
}

static void release(const fmi2CallbackFunctions *host, void *memory) {
    if (host->allocateMemory && host->freeMemory)
        host->freeMemory(memory);
    else if (!host->allocateMemory)
        free(memory);
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *host, fmi2Boolean visible, fmi2Boolean logging) {
    (void)resources, (void)visible;
#define NO_INSTANCE(...) return tell(host, name, PROBLEMS, ERROR, fmi2Error, __VA_ARGS__), NULL
    if (!host) return NULL;
    if (!name || !*name) {
        name = MODEL;
        NO_INSTANCE("fmi2Instantiate: an instance name is needed");
    }
    if (type != fmi2CoSimulation) NO_INSTANCE("fmi2Instantiate: type %d is not supported, only co-simulation is", (int)type);
    if (!guid || strcmp(guid, GUID) != 0)
        NO_INSTANCE("fmi2Instantiate: the GUID %s is not this FMU's, %s", guid ? guid : "(null)", GUID);
    const size_t length = strlen(name) + 1;
    Instance *m = allocate(host, sizeof *m + length);
    if (!m) NO_INSTANCE("fmi2Instantiate: no memory");
    m->host = *host;
    m->logged = logging ? ALL | 15 : PROBLEMS;
    memcpy(m->name, name, length);
    restart(&m->state);
    return m;
}

void fmi2FreeInstance(fmi2Component c) {
    Instance *m = c;
    if (!m) return;
    const fmi2CallbackFunctions host = m->host;
    release(&host, m);
}

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String names[]) {
    INSTANCE("fmi2SetDebugLogging", ANY);
    uint32_t chosen = n ? 0 : ALL | 15;
    if (n && !names) REFUSE("fmi2SetDebugLogging: the categories are null");
    for (size_t i = 0; i < n; i++) {
        uint32_t bits = 0;
        for (size_t k = 0; k < N_CATEGORIES; k++)
            if (names[i] && strcmp(names[i], CATEGORIES[k].name) == 0) bits = CATEGORIES[k].bits;
        if (!bits) REFUSE("fmi2SetDebugLogging: no category %s", names[i] ? names[i] : "(null)");
        chosen |= bits;
    }
    m->logged = on ? chosen : m->logged & ~chosen;
    return fmi2OK;
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerance_defined, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean stop_defined, fmi2Real stop) {
    INSTANCE("fmi2SetupExperiment", INSTANTIATED);
    if (!isfinite(start)) REFUSE("start time %g s refused: a finite number is needed", start);
    if (stop_defined && !(stop >= start)) REFUSE("stop time %g s refused: it is before the start time %g s", stop, start);
    if (tolerance_defined && !(isfinite(tolerance) && tolerance > 0.0))
        REFUSE("tolerance %g refused: a number above 0 is needed", tolerance);
    m->state.start = m->state.point = start;
    m->state.stop = stop_defined ? stop : INFINITY;
    m->state.tolerance = tolerance_defined ? tolerance : 0.0;
    return fmi2OK;
}

static int initialize(State *s) {
    s->status = ema_initialize(s->v, s->x);
    s->x[TOLERANCE] = s->tolerance;
    s->fresh = 1;
    return s->status;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    INSTANCE("fmi2EnterInitializationMode", INSTANTIATED);
    m->state.mode = INITIALIZING;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    INSTANCE("fmi2ExitInitializationMode", INITIALIZING);
    m->state.mode = RUNNING;
    if (initialize(&m->state)) {
        m->state.mode = FAILED;
        REFUSE(MODEL " cannot start: %s", STATUS[m->state.status]);
    }
    return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component c) {
    INSTANCE("fmi2Terminate", RUNNING);
    m->state.mode = TERMINATED;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c) {
    INSTANCE("fmi2Reset", ANY);
    restart(&m->state);
    return fmi2OK;
}

/* ------------------------------------------------------------------------------------------------------------ values */

static const char *const KINDS[] = {"Real", "Integer", "Boolean", "String"};

/* Why the references and the values cannot be used; NULL if they can. */
static const char *unusable(const fmi2ValueReference vr[], size_t n, const void *values) {
    return !n || (vr && values) ? NULL : "the value references or the values are null";
}

#define CHECK_REFERENCES(function, kind_)                                                                          \
    do {                                                                                                           \
        const char *problem = unusable(vr, n, value);                                                              \
        if (problem) REFUSE(function ": %s", problem);                                                             \
        for (size_t i = 0; i < n; i++)                                                                             \
            if (vr[i] >= N_VARIABLES || KIND_OF[vr[i]] != kind_)                                                       \
                REFUSE("value reference %u is no %s variable of " MODEL, vr[i], KINDS[kind_]);                     \
    } while (0)

enum { READABLE = INITIALIZING | RUNNING | TERMINATED | FAILED, SETTABLE = INSTANTIATED | INITIALIZING | RUNNING };

static fmi2Status refresh(Instance *m) {
    if (m->state.mode == INITIALIZING && !m->state.fresh && initialize(&m->state))
        REFUSE(MODEL " cannot start: %s", STATUS[m->state.status]);
    return fmi2OK;
}

#define GET(function, kind_, type)                                                                                 \
    INSTANCE(function, READABLE);                                                                                  \
    CHECK_REFERENCES(function, kind_);                                                                             \
    const fmi2Status status = refresh(m);                                                                          \
    for (size_t i = 0; i < n; i++) value[i] = (type)m->state.v[vr[i]];                                             \
    return status

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
    GET("fmi2GetReal", REAL, fmi2Real);
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Integer value[]) {
    GET("fmi2GetInteger", INTEGER, fmi2Integer);
}

fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Boolean value[]) {
    GET("fmi2GetBoolean", BOOLEAN, fmi2Boolean);
}

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2String value[]) {
    INSTANCE("fmi2GetString", READABLE);
    CHECK_REFERENCES("fmi2GetString", STRING);
    return fmi2OK;
}

/* Whether `value` may be set; logs why not. */
static fmi2Status check(const Instance *m, fmi2ValueReference vr, double value) {
    const State *s = &m->state;
    const Variable *variable = &VARIABLES[vr];
#define KEEP(...) REFUSE("%s = %.15g refused: " __VA_ARGS__)
    if (variable->causality != INPUT && variable->causality != PARAMETER)
        KEEP("only the FMU sets it; it stays %.15g", variable->name, value, s->v[vr]);
    if (!isfinite(value)) KEEP("a finite number is needed; it stays %.15g", variable->name, value, s->v[vr]);
    if (value < variable->minimum)
        KEEP("it is less than the minimum %.15g; it stays %.15g", variable->name, value, variable->minimum, s->v[vr]);
    if (value > variable->maximum)
        KEEP("it is more than the maximum %.15g; it stays %.15g", variable->name, value, variable->maximum, s->v[vr]);
    if (variable->fixed && s->mode == RUNNING)
        KEEP("a fixed parameter cannot change after initialization; it stays %.15g", variable->name, value, s->v[vr]);
    return fmi2OK;
}

static void set(State *s, fmi2ValueReference vr, double value) {
    s->v[vr] = value;
    s->fresh = 0;
    if (VARIABLES[vr].causality == PARAMETER) s->x[STALE] = 1.0;
}

/* All of the values or none. */
#define SET(function, kind_, converted)                                                                            \
    INSTANCE(function, SETTABLE);                                                                                  \
    CHECK_REFERENCES(function, kind_);                                                                             \
    fmi2Status status = fmi2OK;                                                                                    \
    for (size_t i = 0; i < n; i++)                                                                                 \
        if (check(m, vr[i], converted) != fmi2OK) status = fmi2Error;                                              \
    for (size_t i = 0; i < n && status == fmi2OK; i++) set(&m->state, vr[i], converted);                           \
    return status

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]) {
    SET("fmi2SetReal", REAL, value[i]);
}

fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer value[]) {
    SET("fmi2SetInteger", INTEGER, value[i]);
}

fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Boolean value[]) {
    SET("fmi2SetBoolean", BOOLEAN, value[i] ? 1.0 : 0.0);
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2String value[]) {
    INSTANCE("fmi2SetString", SETTABLE);
    CHECK_REFERENCES("fmi2SetString", STRING);
    return fmi2OK;
}

/* The slopes hold for the next step and are zero again after it. */
fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer order[],
                                       const fmi2Real value[]) {
    INSTANCE("fmi2SetRealInputDerivatives", SETTABLE);
    if (n && !order) REFUSE("fmi2SetRealInputDerivatives: the orders are null");
    CHECK_REFERENCES("fmi2SetRealInputDerivatives", REAL);
    for (size_t i = 0; i < n; i++) {
        if (VARIABLES[vr[i]].causality != INPUT) REFUSE("derivative of %s refused: it is no input", VARIABLES[vr[i]].name);
        if (order[i] != 1) REFUSE("derivative of order %d refused: order 1 is supported", (int)order[i]);
        if (!isfinite(value[i])) REFUSE("derivative of %s refused: a finite number is needed", VARIABLES[vr[i]].name);
    }
    for (size_t i = 0; i < n; i++) m->state.slope[INPUT_OF[vr[i]]] = value[i];
    return fmi2OK;
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer order[],
                                        fmi2Real value[]) {
    INSTANCE("fmi2GetRealOutputDerivatives", READABLE);
    (void)vr, (void)order, (void)value;
    if (n) REFUSE("fmi2GetRealOutputDerivatives: not supported (maxOutputDerivativeOrder is 0)");
    return fmi2OK;
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknown[], size_t n_unknown,
                                        const fmi2ValueReference known[], size_t n_known, const fmi2Real delta_known[],
                                        fmi2Real delta_unknown[]) {
    INSTANCE("fmi2GetDirectionalDerivative", READABLE);
    (void)unknown, (void)n_unknown, (void)known, (void)n_known, (void)delta_known, (void)delta_unknown;
    REFUSE("fmi2GetDirectionalDerivative: not supported (providesDirectionalDerivative is false)");
}

/* -------------------------------------------------------------------------------------------------------------- steps */

/* How far from `time` another time may lie to count as the same [s]: hosts add up their steps. */
static double slack(double time) { return 1e-10 + 1e-9 * fabs(time); }

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean no_set_state_prior) {
    INSTANCE("fmi2DoStep", RUNNING);
    (void)no_set_state_prior;
    State *s = &m->state;
    const double end = time + step;
#define NO_STEP(...) DISCARD("step from %.15g s over %.15g s discarded: " __VA_ARGS__)
    if (!(isfinite(time) && isfinite(step))) NO_STEP("time and step must be finite", time, step);
    if (step <= 0.0) NO_STEP("a step of more than 0 s is needed", time, step);
    if (fabs(time - s->point) > slack(s->point))
        NO_STEP("it does not follow the last communication point, %.15g s", time, step, s->point);
    if (end <= s->point) NO_STEP("it is too short: it would end at %.15g s, and the FMU is at %.15g s", time, step, end, s->point);
    if (end > s->stop + slack(s->stop)) NO_STEP("it would end at %.15g s, after the stop time %.15g s", time, step, end, s->stop);
    for (size_t i = 0; i < N_INPUTS; i++) s->x[SLOPE_OF[i]] = s->slope[i];
    s->status = ema_advance(s->v, s->x, end - s->start);
    memset(s->slope, 0, sizeof s->slope);
    if (s->status) {
        s->mode = FAILED;
        s->last = fmi2Error;
        REFUSE("step from %.15g s over %.15g s failed: %s", time, step, STATUS[s->status]);
    }
    s->point = end;
    return s->last = fmi2OK;
}

fmi2Status fmi2CancelStep(fmi2Component c) {
    INSTANCE("fmi2CancelStep", 0);
    return fmi2Error;
}

#define STATUS_OF(function)                                                                                        \
    INSTANCE(function, RUNNING | TERMINATED | FAILED);                                                             \
    if (!value) REFUSE(function ": the value is null")

fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Status *value) {
    STATUS_OF("fmi2GetStatus");
    if (kind != fmi2DoStepStatus) return fmi2Discard;
    *value = m->state.last;
    return fmi2OK;
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value) {
    STATUS_OF("fmi2GetRealStatus");
    if (kind != fmi2LastSuccessfulTime) return fmi2Discard;
    *value = m->state.point;
    return fmi2OK;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value) {
    STATUS_OF("fmi2GetIntegerStatus");
    (void)kind;
    return fmi2Discard;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value) {
    STATUS_OF("fmi2GetBooleanStatus");
    if (kind != fmi2Terminated) return fmi2Discard;
    *value = m->state.mode == FAILED ? fmi2True : fmi2False;
    return fmi2OK;
}

fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind kind, fmi2String *value) {
    STATUS_OF("fmi2GetStringStatus");
    (void)kind;
    return fmi2Discard;
}

/* -------------------------------------------------------------------------------------------------------------- state */

/* A state outside the instance, in memory and as bytes alike; the layout is the same on every platform. */
typedef struct {
    char magic[8];
    uint64_t size;
    char guid[40];
    uint64_t checksum; /* FNV-1a, 64 bits, over `state` */
    State state;
} Saved;

static const char MAGIC[8] = "EMAtwin";

static uint64_t checksum(const State *s) {
    const unsigned char *bytes = (const unsigned char *)s;
    uint64_t sum = 14695981039346656037u;
    for (size_t i = 0; i < sizeof *s; i++) sum = (sum ^ bytes[i]) * 1099511628211u;
    return sum;
}

/* Why `saved` is no state of this FMU; NULL if it is one. */
static const char *foreign(const Saved *saved) {
    if (memcmp(saved->magic, MAGIC, sizeof MAGIC) != 0 || saved->size != sizeof *saved) return "it is none of this software's";
    if (strncmp(saved->guid, GUID, sizeof saved->guid) != 0) return "it is of another FMU";
    if (saved->checksum != checksum(&saved->state) || saved->state.status < 0 || saved->state.status >= N_STATUS)
        return "it is damaged";
    return NULL;
}

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *place) {
    INSTANCE("fmi2GetFMUstate", ANY);
    if (!place) REFUSE("fmi2GetFMUstate: the place for the state is null");
    Saved *saved = *place;
    if (saved && foreign(saved)) REFUSE("fmi2GetFMUstate: the state to write over is refused: %s", foreign(saved));
    if (!saved && !(saved = allocate(&m->host, sizeof *saved))) REFUSE("fmi2GetFMUstate: no memory");
    memcpy(saved->magic, MAGIC, sizeof MAGIC);
    saved->size = sizeof *saved;
    memcpy(saved->guid, GUID, sizeof GUID);
    saved->state = m->state;
    saved->checksum = checksum(&saved->state);
    *place = saved;
    return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
    INSTANCE("fmi2SetFMUstate", ANY);
    const Saved *saved = state;
    const char *problem = saved ? foreign(saved) : "it is null";
    if (problem) REFUSE("the FMU state is refused: %s; nothing changed", problem);
    m->state = saved->state;
    return fmi2OK;
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *place) {
    INSTANCE("fmi2FreeFMUstate", ANY);
    if (!place || !*place) return fmi2OK;
    if (foreign(*place)) REFUSE("fmi2FreeFMUstate: the state is refused: %s", foreign(*place));
    memset(*place, 0, sizeof(Saved)); /* a second use of the memory is refused, if the host has not reused it */
    release(&m->host, *place);
    *place = NULL;
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size) {
    INSTANCE("fmi2SerializedFMUstateSize", ANY);
    if (!state || !size) REFUSE("fmi2SerializedFMUstateSize: the state or the size is null");
    *size = sizeof(Saved);
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size) {
    INSTANCE("fmi2SerializeFMUstate", ANY);
    if (!state || !bytes) REFUSE("fmi2SerializeFMUstate: the state or the place for the bytes is null");
    if (foreign(state)) REFUSE("fmi2SerializeFMUstate: the state is refused: %s", foreign(state));
    if (size < sizeof(Saved)) REFUSE("fmi2SerializeFMUstate: %zu bytes of room, %zu are needed", size, sizeof(Saved));
    memcpy(bytes, state, sizeof(Saved));
    return fmi2OK;
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *place) {
    INSTANCE("fmi2DeSerializeFMUstate", ANY);
    if (!bytes || !place) REFUSE("fmi2DeSerializeFMUstate: the bytes or the place for the state are null");
    if (size < sizeof(Saved)) REFUSE("the serialised state is refused: it has %zu bytes, %zu are needed", size, sizeof(Saved));
    Saved copy;
    memcpy(&copy, bytes, sizeof copy);
    const char *problem = foreign(&copy);
    if (problem) REFUSE("the serialised state is refused: %s", problem);
    Saved *saved = allocate(&m->host, sizeof *saved);
    if (!saved) REFUSE("fmi2DeSerializeFMUstate: no memory");
    *saved = copy;
    *place = saved;
    return fmi2OK;
}
