/* An FMU that misbehaves in the way that the environment variable BAD names (several by commas), in its steps after 0.1 s:
   CRASH, HANG, FATAL, NEGATIVE (status -7), EXIT, FORK (a grandchild that leaves the group and holds every pipe), PRINT (60 MB
   and more), ALLOCATE (without end), FORGE (a pickled command into every connection), LIE or HUGE in its outputs. Compiled
   with -DMISSING, it is without fmi2GetReal; -DALWAYS="CRASH" names the way at compilation. */

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "fmi2Functions.h"

static int bad_by(const char *way) {
#ifdef ALWAYS /* for processes that were there before the variable */
    const char *told = ALWAYS;
#else
    const char *told = getenv("BAD");
#endif
    return told && strstr(told, way);
}

typedef struct { double time; int done; } Bad;

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *host, fmi2Boolean visible, fmi2Boolean logging) {
    (void)name, (void)type, (void)guid, (void)resources, (void)host, (void)visible, (void)logging;
    return calloc(1, sizeof(Bad));
}
void fmi2FreeInstance(fmi2Component c) { free(c); }

#define ACCEPT(name, ...) \
    fmi2Status name(fmi2Component c, __VA_ARGS__) { return c ? fmi2OK : fmi2Error; }
#define ACCEPT0(name) \
    fmi2Status name(fmi2Component c) { return c ? fmi2OK : fmi2Error; }

ACCEPT(fmi2SetDebugLogging, fmi2Boolean on, size_t n, const fmi2String names[])
ACCEPT(fmi2SetupExperiment, fmi2Boolean a, fmi2Real b, fmi2Real s, fmi2Boolean d, fmi2Real e)
ACCEPT0(fmi2EnterInitializationMode)
ACCEPT0(fmi2ExitInitializationMode)
ACCEPT0(fmi2Terminate)
ACCEPT0(fmi2Reset)
ACCEPT(fmi2SetReal, const fmi2ValueReference vr[], size_t n, const fmi2Real v[])
ACCEPT(fmi2SetInteger, const fmi2ValueReference vr[], size_t n, const fmi2Integer v[])
ACCEPT(fmi2SetBoolean, const fmi2ValueReference vr[], size_t n, const fmi2Boolean v[])
ACCEPT(fmi2SetRealInputDerivatives, const fmi2ValueReference vr[], size_t n, const fmi2Integer o[], const fmi2Real v[])

ACCEPT(fmi2GetInteger, const fmi2ValueReference vr[], size_t n, fmi2Integer v[])
ACCEPT(fmi2GetString, const fmi2ValueReference vr[], size_t n, fmi2String v[])
ACCEPT(fmi2SetString, const fmi2ValueReference vr[], size_t n, const fmi2String v[])
ACCEPT(fmi2GetFMUstate, fmi2FMUstate *state)
ACCEPT(fmi2SetFMUstate, fmi2FMUstate state)
ACCEPT(fmi2FreeFMUstate, fmi2FMUstate *state)
ACCEPT(fmi2SerializedFMUstateSize, fmi2FMUstate state, size_t *size)
ACCEPT(fmi2SerializeFMUstate, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
ACCEPT(fmi2DeSerializeFMUstate, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
ACCEPT(fmi2GetDirectionalDerivative, const fmi2ValueReference u[], size_t m, const fmi2ValueReference k[], size_t n,
       const fmi2Real dk[], fmi2Real du[])
ACCEPT(fmi2GetRealOutputDerivatives, const fmi2ValueReference vr[], size_t n, const fmi2Integer o[], fmi2Real v[])
ACCEPT0(fmi2CancelStep)
ACCEPT(fmi2GetStatus, const fmi2StatusKind kind, fmi2Status *v)
ACCEPT(fmi2GetRealStatus, const fmi2StatusKind kind, fmi2Real *v)
ACCEPT(fmi2GetIntegerStatus, const fmi2StatusKind kind, fmi2Integer *v)
ACCEPT(fmi2GetBooleanStatus, const fmi2StatusKind kind, fmi2Boolean *v)
ACCEPT(fmi2GetStringStatus, const fmi2StatusKind kind, fmi2String *v)

#ifndef MISSING
fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real v[]) {
    Bad *bad = c;
    for (size_t i = 0; i < n; i++) {
        v[i] = bad->time * vr[i];
        if (bad->time > 0.1 && bad_by("LIE")) v[i] = NAN;
        if (bad->time > 0.1 && bad_by("HUGE")) v[i] = i % 2 ? 1.7e308 : -1.7e308;
    }
    return fmi2OK;
}
#endif

fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Boolean v[]) {
    (void)c, (void)vr;
    for (size_t i = 0; i < n; i++) v[i] = 0;
    return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean no_set_state_prior) {
    (void)no_set_state_prior;
    Bad *bad = c;
    bad->time = time + step;
    if (bad->time <= 0.1) return fmi2OK;
    if (bad_by("CRASH")) abort();
    if (bad_by("HANG")) {
        fputs("hangs\n", stderr);
        for (volatile int spin = 1; spin;) {}
    }
    if (bad_by("FATAL")) return fmi2Fatal;
    if (bad_by("NEGATIVE")) return (fmi2Status)-7;
    if (bad_by("EXIT")) exit(0);
    if (bad_by("FORK") && !bad->done++ && fork() == 0) {
        setsid();
        for (;;) sleep(1);
    }
    if (bad_by("PRINT") && bad->done < 60) {
        static char line[1000001];
        memset(line, 'x', 1000000), line[999999] = '\n';
        fputs(line, bad->done++ % 2 ? stdout : stderr);
    }
    if (bad_by("ALLOCATE"))
        for (char *more; (more = malloc(1 << 26)); ) memset(more, 1, 1 << 26);
    if (bad_by("FORGE")) {
        static const char pickled[] = "cos\nsystem\n(S'touch \"$BAD_TOUCHES\"'\ntR.";
        for (int file = 3; file < 64; file++)
            if (write(file, pickled, sizeof pickled - 1) < 0) continue;
    }
    return fmi2OK;
}
