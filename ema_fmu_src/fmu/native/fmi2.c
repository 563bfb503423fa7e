/* FMI 2.0 for co-simulation, as an adapter of instance.h: its names, types, callbacks and status codes, and which call it
   allows when (FMI 2.0.5, section 4.2.4). A value out of its range has the status fmi2Discard (2.1.3); any other refused call,
   and a step that cannot be taken, fmi2Error (2.1.6, 4.2.2). After either the instance works on, which FMI does not ask. */

#include <stdlib.h>

#include "fmi2Functions.h"
#include "instance.h"

_Static_assert(sizeof(fmi2ValueReference) == sizeof(Reference) && sizeof(fmi2Integer) == sizeof(int32_t), "types");
_Static_assert(OK == (int)fmi2OK && DISCARDED == (int)fmi2Discard && ERROR == (int)fmi2Error, "status codes");

static fmi2Status status(Outcome outcome) { return (fmi2Status)outcome; }

/* Opens every function: the instance `m`, refused where there is none or the standard does not allow the call. */
#define INSTANCE(function, modes)                                                                                  \
    Instance *m = c;                                                                                               \
    if (!m) return fmi2Error;                                                                                      \
    if (!(instance_mode(m) & (modes))) return status(instance_refuse_in_mode(m, function))

enum { READABLE = INITIALIZING | RUNNING | TERMINATED | FAILED, SETTABLE = INSTANTIATED | INITIALIZING | RUNNING };

/* --- life and logging ----------------------------------------------------------------------------------------------- */

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }

const char *fmi2GetVersion(void) { return fmi2Version; }

static void log_message(const Host *host, const char *name, Outcome outcome, const char *category, char *text) {
    for (char *c = text; *c; c++)
        if (*c == '%') *c = '#'; /* hosts pass the message to printf */
    ((fmi2CallbackLogger)host->logger)(host->environment, name, status(outcome), category, text);
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging) {
    (void)resources, (void)visible;
    if (!functions) return NULL;
    const Host host = {
        .log = log_message,
        .logger = (void (*)(void))functions->logger,
        .environment = functions->componentEnvironment,
        .allocate = functions->allocateMemory ? functions->allocateMemory : calloc,
        .release = functions->allocateMemory ? functions->freeMemory : free,
    };
    if (type != fmi2CoSimulation) {
        host_tell(&host, name, "fmi2Instantiate: type %d is not supported, only co-simulation is", (int)type);
        return NULL;
    }
    return instance_create(&host, name, "GUID", guid, logging);
}

void fmi2FreeInstance(fmi2Component c) {
    if (c) instance_free(c);
}

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[]) {
    INSTANCE("fmi2SetDebugLogging", ANY);
    return status(instance_choose_logged(m, on, n, categories));
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerance_defined, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean stop_defined, fmi2Real stop) {
    INSTANCE("fmi2SetupExperiment", INSTANTIATED);
    return status(instance_set_experiment(m, tolerance_defined ? &tolerance : NULL, start, stop_defined ? &stop : NULL));
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    INSTANCE("fmi2EnterInitializationMode", INSTANTIATED);
    instance_enter_initialization(m);
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    INSTANCE("fmi2ExitInitializationMode", INITIALIZING);
    return status(instance_exit_initialization(m));
}

fmi2Status fmi2Terminate(fmi2Component c) {
    INSTANCE("fmi2Terminate", RUNNING);
    instance_terminate(m);
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c) {
    INSTANCE("fmi2Reset", ANY);
    instance_reset(m);
    return fmi2OK;
}

/* --- values --------------------------------------------------------------------------------------------------------- */

#define ACCESS(name, type, own)                                                                                    \
    fmi2Status fmi2Get##name(fmi2Component c, const fmi2ValueReference vr[], size_t n, type value[]) {             \
        INSTANCE("fmi2Get" #name, READABLE);                                                                       \
        return status(instance_get_##own(m, vr, n, value));                                                        \
    }                                                                                                              \
    fmi2Status fmi2Set##name(fmi2Component c, const fmi2ValueReference vr[], size_t n, const type value[]) {       \
        INSTANCE("fmi2Set" #name, SETTABLE);                                                                       \
        return status(instance_set_##own(m, vr, n, value));                                                        \
    }

ACCESS(Real, fmi2Real, double)
ACCESS(Integer, fmi2Integer, int32)
ACCESS(Boolean, fmi2Boolean, flag)

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2String value[]) {
    INSTANCE("fmi2GetString", READABLE);
    return status(instance_use_string(m, vr, n, value));
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2String value[]) {
    INSTANCE("fmi2SetString", SETTABLE);
    return status(instance_use_string(m, vr, n, value));
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer order[],
                                       const fmi2Real value[]) {
    INSTANCE("fmi2SetRealInputDerivatives", SETTABLE);
    if (n && !order) return status(instance_tell(m, ERROR, "fmi2SetRealInputDerivatives: the orders are null"));
    for (size_t i = 0; i < n; i++)
        if (order[i] != 1)
            return status(instance_tell(m, ERROR, "derivative of order %d refused: order 1 is supported", (int)order[i]));
    return status(instance_set_slope(m, vr, n, value));
}

#define UNSUPPORTED(function, why) return status(instance_tell(m, ERROR, function ": not supported (" why ")"))

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer order[],
                                        fmi2Real value[]) {
    INSTANCE("fmi2GetRealOutputDerivatives", READABLE);
    (void)vr, (void)order, (void)value;
    if (n) UNSUPPORTED("fmi2GetRealOutputDerivatives", "maxOutputDerivativeOrder is 0");
    return fmi2OK;
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknown[], size_t n_unknown,
                                        const fmi2ValueReference known[], size_t n_known, const fmi2Real delta_known[],
                                        fmi2Real delta_unknown[]) {
    INSTANCE("fmi2GetDirectionalDerivative", READABLE);
    (void)unknown, (void)n_unknown, (void)known, (void)n_known, (void)delta_known, (void)delta_unknown;
    UNSUPPORTED("fmi2GetDirectionalDerivative", "providesDirectionalDerivative is false");
}

/* --- steps ---------------------------------------------------------------------------------------------------------- */

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean no_set_state_prior) {
    INSTANCE("fmi2DoStep", RUNNING);
    (void)no_set_state_prior;
    return status(instance_step(m, time, step));
}

fmi2Status fmi2CancelStep(fmi2Component c) {
    INSTANCE("fmi2CancelStep", 0); /* no step is ever pending */
    return fmi2Error;
}

/* A query of one kind of status, answered with `answer`; there is nothing to tell of the other kinds. */
#define STATUS(name, type, known, answer)                                                                          \
    fmi2Status fmi2Get##name(fmi2Component c, const fmi2StatusKind kind, type *value) {                            \
        INSTANCE("fmi2Get" #name, RUNNING | TERMINATED | FAILED);                                                  \
        (void)kind;                                                                                                \
        if (!value) return status(instance_tell(m, ERROR, "fmi2Get" #name ": the value is null"));                 \
        if (!(known)) return fmi2Discard;                                                                          \
        *value = answer;                                                                                           \
        return fmi2OK;                                                                                             \
    }

STATUS(Status, fmi2Status, kind == fmi2DoStepStatus, status(instance_last_outcome(m)))
STATUS(RealStatus, fmi2Real, kind == fmi2LastSuccessfulTime, instance_time(m))
STATUS(IntegerStatus, fmi2Integer, false, 0)
STATUS(BooleanStatus, fmi2Boolean, kind == fmi2Terminated, instance_mode(m) == FAILED ? fmi2True : fmi2False)
STATUS(StringStatus, fmi2String, false, NULL)

/* --- state ---------------------------------------------------------------------------------------------------------- */

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *place) {
    INSTANCE("fmi2GetFMUstate", ANY);
    return status(instance_save(m, place));
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
    INSTANCE("fmi2SetFMUstate", ANY);
    return status(instance_restore(m, state));
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *place) {
    INSTANCE("fmi2FreeFMUstate", ANY);
    return status(instance_free_state(m, place));
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size) {
    INSTANCE("fmi2SerializedFMUstateSize", ANY);
    return status(instance_serialised_size(m, state, size));
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size) {
    INSTANCE("fmi2SerializeFMUstate", ANY);
    return status(instance_serialise(m, state, bytes, size));
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *place) {
    INSTANCE("fmi2DeSerializeFMUstate", ANY);
    return status(instance_deserialise(m, bytes, size, place));
}
