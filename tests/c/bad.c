/* An FMU that misbehaves: -DCRASH, -DHANG, -DFATAL in its steps after 0.1 s, -DLIE in its outputs,
   -DMISSING without fmi2GetReal. */

#include <math.h>
#include <stdlib.h>

#include "fmi2Functions.h"

typedef struct { double time; } Bad;

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
#ifdef LIE
        if (bad->time > 0.1) v[i] = NAN;
#endif
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
    if (bad->time > 0.1) {
#ifdef CRASH
        abort();
#endif
#ifdef HANG
        for (volatile int spin = 1; spin;) {}
#endif
#ifdef FATAL
        return fmi2Fatal;
#endif
    }
    return fmi2OK;
}
