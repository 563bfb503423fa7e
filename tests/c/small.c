/* Small FMUs of one library; the GUID says which, and after a colon its manners. Value references count per type.

   affine   y[i] = sum over j of A[i][j]*u[j] + b[i], at once: Reals y 0..1, u 2..3, A 4..7 (by rows), b 8..9
   cosine   y[0] = cos(u[0])
   mass     dx/dt = v, dv/dt = u[0]/M, exact for a held force: y[0] = x, y[1] = v; M is A[0][0], x and v start at b
   clock    y[0] = the time that fmi2DoStep has last reached, y[1] = the sum of its steps
   mirror   Integer 0 = Integer 1 + 1, 3 (an Enumeration) = 4, Boolean 0 = not Boolean 1, String 0 = String 1 and "!",
            y[0] = the length of String 1
   twin     y[0] = u[0]

   The manners are the GUID's or Integer 2, a bit for each thing that is done otherwise: */
enum { WARNS = 1, NO_RESET = 2, FALSE_RESET = 4, NEEDS_STOP = 8, REFUSES_INPUT = 16, REFUSES_OUTPUT = 32, EXITS = 64,
       REFUSES_STEP = 128, EQUAL_STEPS = 256, SLOW = 512 };

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "fmi2Functions.h"

typedef struct {
    double r[10], time, sum, first, x, v;
    int i[5], b[2], running, told_stop, manners;
    char s[2][8192], kind[16], name[64];
    const fmi2CallbackFunctions *host;
} Small;

static void begin(Small *m) {
    memset(m->r, 0, sizeof m->r);
    m->time = m->sum = m->first = m->x = m->v = 0;
    memset(m->i, 0, sizeof m->i);
    memset(m->b, 0, sizeof m->b);
    memset(m->s, 0, sizeof m->s);
    m->running = m->told_stop = 0;
}
#define TELL(status, ...) (m->host->logger(m->host->componentEnvironment, m->name, status, "log", __VA_ARGS__), status)
#define DOES(way) ((m->i[2] | m->manners) & (way))
#define IS(which) (!strcmp(m->kind, which))

static void compute(Small *m) {
    double *y = m->r, *u = m->r + 2, *A = m->r + 4, *b = m->r + 8;
    if (IS("affine"))
        for (int i = 0; i < 2; i++) y[i] = A[2 * i] * u[0] + A[2 * i + 1] * u[1] + b[i];
    if (IS("twin")) y[0] = u[0];
    if (IS("cosine")) y[0] = cos(u[0]);
    if (IS("mass")) y[0] = m->running ? m->x : b[0], y[1] = m->running ? m->v : b[1];
    if (IS("clock")) y[0] = m->time, y[1] = m->sum;
    if (IS("mirror")) {
        m->i[0] = m->i[1] + 1;
        m->i[3] = m->i[4];
        m->b[0] = !m->b[1];
        y[0] = (double)strlen(m->s[1]);
        strcpy(m->s[0], m->s[1]);
        strcat(m->s[0], "!");
    }
}

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *host, fmi2Boolean visible, fmi2Boolean logging) {
    (void)type, (void)resources, (void)visible, (void)logging;
    Small *m = calloc(1, sizeof(Small));
    const char *colon = strchr(guid, ':');
    strncpy(m->kind, guid, colon ? (size_t)(colon - guid) : sizeof m->kind - 1);
    m->manners = colon ? atoi(colon + 1) : 0;
    strncpy(m->name, name, sizeof m->name - 1);
    m->host = host;
    return m;
}
void fmi2FreeInstance(fmi2Component c) { free(c); }

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean a, fmi2Real b, fmi2Real start, fmi2Boolean stops, fmi2Real stop) {
    Small *m = c;
    (void)a, (void)b;
    m->time = start;
    m->told_stop = stops && stop >= start;
    return fmi2OK;
}
fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    Small *m = c;
    if (DOES(NEEDS_STOP) && !m->told_stop) return TELL(fmi2Error, "stop time %s", "is needed");
    return fmi2OK;
}
fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    Small *m = c;
    compute(m);
    m->x = m->r[8];
    m->v = m->r[9];
    m->running = 1;
    if (DOES(WARNS)) return TELL(fmi2Warning, "gain %g of %s has %d digits", m->r[4], m->name, 7);
    return fmi2OK;
}
fmi2Status fmi2Terminate(fmi2Component c) { return c ? fmi2OK : fmi2Error; }
fmi2Status fmi2Reset(fmi2Component c) {
    Small *m = c;
    if (DOES(NO_RESET)) return fmi2Error;
    if (!DOES(FALSE_RESET)) begin(m);
    return fmi2OK;
}

#define EACH for (size_t k = 0; k < n; k++)
typedef const fmi2ValueReference *References;
fmi2Status fmi2SetReal(fmi2Component c, References vr, size_t n, const fmi2Real v[]) {
    Small *m = c;
    EACH {
        if (m->running && DOES(REFUSES_INPUT) && vr[k] == 2) return TELL(fmi2Error, "input %u refused: %g %s", vr[k], v[k], "N");
        m->r[vr[k]] = v[k];
    }
    return fmi2OK;
}
fmi2Status fmi2GetReal(fmi2Component c, References vr, size_t n, fmi2Real v[]) {
    Small *m = c;
    if (m->running && DOES(REFUSES_OUTPUT)) return fmi2Error;
    compute(m);
    EACH v[k] = m->r[vr[k]];
    return fmi2OK;
}
fmi2Status fmi2SetInteger(fmi2Component c, References vr, size_t n, const fmi2Integer v[]) {
    EACH ((Small *)c)->i[vr[k]] = v[k];
    return fmi2OK;
}
fmi2Status fmi2GetInteger(fmi2Component c, References vr, size_t n, fmi2Integer v[]) {
    compute(c);
    EACH v[k] = ((Small *)c)->i[vr[k]];
    return fmi2OK;
}
fmi2Status fmi2SetBoolean(fmi2Component c, References vr, size_t n, const fmi2Boolean v[]) {
    EACH ((Small *)c)->b[vr[k]] = v[k];
    return fmi2OK;
}
fmi2Status fmi2GetBoolean(fmi2Component c, References vr, size_t n, fmi2Boolean v[]) {
    compute(c);
    EACH v[k] = ((Small *)c)->b[vr[k]];
    return fmi2OK;
}
fmi2Status fmi2SetString(fmi2Component c, References vr, size_t n, const fmi2String v[]) {
    EACH strncpy(((Small *)c)->s[vr[k]], v[k], sizeof ((Small *)c)->s[0] - 2);
    return fmi2OK;
}
fmi2Status fmi2GetString(fmi2Component c, References vr, size_t n, fmi2String v[]) {
    compute(c);
    EACH v[k] = ((Small *)c)->s[vr[k]];
    return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean no_set_state_prior) {
    Small *m = c;
    (void)no_set_state_prior;
    if (DOES(EXITS)) exit(0);
    if (DOES(SLOW)) nanosleep(&(struct timespec){0, 1000000}, NULL);
    if (DOES(REFUSES_STEP)) return TELL(fmi2Error, "step of %g s refused", step);
    if (m->first == 0) m->first = step;
    if (DOES(EQUAL_STEPS) && fabs(step - m->first) > 1e-9 * m->first) return fmi2Discard;
    if (IS("mass")) {
        const double a = m->r[2] / m->r[4];
        m->x += (m->v + 0.5 * a * step) * step;
        m->v += a * step;
    }
    m->time = time + step;
    m->sum += step;
    compute(m);
    return fmi2OK;
}

/* What no test calls, but every importer loads. */
#define UNUSED(name, ...) \
    fmi2Status name(fmi2Component c, __VA_ARGS__) { return c ? fmi2OK : fmi2Error; }
UNUSED(fmi2SetDebugLogging, fmi2Boolean on, size_t n, const fmi2String names[])
UNUSED(fmi2SetRealInputDerivatives, References vr, size_t n, const fmi2Integer o[], const fmi2Real v[])
UNUSED(fmi2GetRealOutputDerivatives, References vr, size_t n, const fmi2Integer o[], fmi2Real v[])
UNUSED(fmi2GetFMUstate, fmi2FMUstate *state)
UNUSED(fmi2SetFMUstate, fmi2FMUstate state)
UNUSED(fmi2FreeFMUstate, fmi2FMUstate *state)
UNUSED(fmi2SerializedFMUstateSize, fmi2FMUstate state, size_t *size)
UNUSED(fmi2SerializeFMUstate, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
UNUSED(fmi2DeSerializeFMUstate, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
UNUSED(fmi2GetDirectionalDerivative, References u, size_t m, References k, size_t n, const fmi2Real dk[], fmi2Real du[])
UNUSED(fmi2GetStatus, const fmi2StatusKind kind, fmi2Status *v)
UNUSED(fmi2GetRealStatus, const fmi2StatusKind kind, fmi2Real *v)
UNUSED(fmi2GetIntegerStatus, const fmi2StatusKind kind, fmi2Integer *v)
UNUSED(fmi2GetBooleanStatus, const fmi2StatusKind kind, fmi2Boolean *v)
UNUSED(fmi2GetStringStatus, const fmi2StatusKind kind, fmi2String *v)
fmi2Status fmi2CancelStep(fmi2Component c) { return c ? fmi2Error : fmi2Fatal; }
