/* A host without Python: loads an FMU's library, runs two interleaved instances, saves and restores a state in the middle,
   and prints every output's bits; before that, it does what a host must not do, and keeps its time in single precision.
   Usage: host LIBRARY GUID. Exit code 0, or 1 with the line that failed on stderr.

   Compiled with the value references COMMAND, LOAD_TORQUE, N_A (fault.N_a), RESISTANCE (motor.R) and the list OUTPUTS. */

#include <math.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2FunctionTypes.h"

#ifdef _WIN32
#include <windows.h>
#define OPEN(path) (void *)LoadLibraryA(path)
#define SYMBOL(library, name) (void *)GetProcAddress((HMODULE)library, name)
#else
#include <dlfcn.h>
#define OPEN(path) dlopen(path, RTLD_NOW | RTLD_LOCAL)
#define SYMBOL(library, name) dlsym(library, name)
#endif

#define NEED(condition) \
    do {                \
        if (!(condition)) { fprintf(stderr, "host.c:%d: %s\n", __LINE__, #condition); exit(1); } \
    } while (0)

static const fmi2ValueReference inputs[] = {COMMAND, LOAD_TORQUE}, fault[] = {N_A}, fixed[] = {RESISTANCE}, outputs[] = {OUTPUTS};
enum { STEPS = 400, N_OUTPUTS = sizeof outputs / sizeof *outputs, STATE_AT = 137 };
static const double STEP = 1e-4;

static void logger(fmi2ComponentEnvironment e, fmi2String n, fmi2Status s, fmi2String c, fmi2String message, ...) {
    (void)e, (void)s;
    fprintf(stderr, "%s [%s] %s\n", n, c, message);
}

#define FUNCTION(name) static name##TYPE *name
FUNCTION(fmi2Instantiate);
FUNCTION(fmi2FreeInstance);
FUNCTION(fmi2SetupExperiment);
FUNCTION(fmi2EnterInitializationMode);
FUNCTION(fmi2ExitInitializationMode);
FUNCTION(fmi2Terminate);
FUNCTION(fmi2SetReal);
FUNCTION(fmi2GetReal);
FUNCTION(fmi2DoStep);
FUNCTION(fmi2GetFMUstate);
FUNCTION(fmi2SetFMUstate);
FUNCTION(fmi2FreeFMUstate);
FUNCTION(fmi2SerializedFMUstateSize);
FUNCTION(fmi2SerializeFMUstate);
FUNCTION(fmi2DeSerializeFMUstate);

static fmi2Component start(const char *name, const char *guid, const fmi2CallbackFunctions *callbacks, double n_a) {
    fmi2Component c = fmi2Instantiate(name, fmi2CoSimulation, guid, "", callbacks, fmi2False, fmi2True);
    NEED(c);
    NEED(fmi2SetReal(c, fault, 1, &n_a) == fmi2OK);
    NEED(fmi2SetupExperiment(c, fmi2False, 0.0, 0.0, fmi2False, 0.0) == fmi2OK);
    NEED(fmi2EnterInitializationMode(c) == fmi2OK);
    NEED(fmi2ExitInitializationMode(c) == fmi2OK);
    return c;
}

static void step(fmi2Component c, int k, double amplitude, double *out) {
    /* a triangle and a load without any library's sine, so that every host commands the same bits */
    const double phase = (k % 200) / 200.0;
    const double values[] = {amplitude * (phase < 0.5 ? phase : 1.0 - phase), k > 200 ? 3.0 : 0.0};
    NEED(fmi2SetReal(c, inputs, 2, values) == fmi2OK);
    NEED(fmi2DoStep(c, k * STEP, STEP, fmi2True) == fmi2OK);
    NEED(fmi2GetReal(c, outputs, N_OUTPUTS, out) == fmi2OK);
}

/* What FMI 2.0.5 wants refused, and how (2.1.3, 2.1.6, 4.2.2); the right call can be made next. */
static void misuse(const char *guid, const fmi2CallbackFunctions *callbacks) {
    fmi2CallbackFunctions quiet = *callbacks;
    quiet.logger = NULL;
    fmi2Component c = fmi2Instantiate("misused", fmi2CoSimulation, guid, "", &quiet, fmi2False, fmi2False);
    NEED(c && fmi2SetupExperiment(c, fmi2False, 0.0, 0.0, fmi2True, 4 * STEP) == fmi2OK);
    NEED(fmi2EnterInitializationMode(c) == fmi2OK && fmi2ExitInitializationMode(c) == fmi2OK);
    const struct { double time, size; } wrong[] = {
        {STEP, 0.0}, {STEP, -STEP}, {0.0, STEP}, {2 * STEP, STEP}, {STEP, 4 * STEP}, {STEP, 1e300}, {STEP, NAN}, {NAN, STEP},
    };
    const double beyond[] = {-0.1, 1.1, NAN}, other = 2.0;
    NEED(fmi2DoStep(c, 0.0, STEP, fmi2True) == fmi2OK);
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++)
        NEED(fmi2DoStep(c, wrong[i].time, wrong[i].size, fmi2True) == fmi2Error);
    for (size_t i = 0; i < sizeof beyond / sizeof *beyond; i++) NEED(fmi2SetReal(c, fault, 1, &beyond[i]) == fmi2Discard);
    NEED(fmi2SetReal(c, fixed, 1, &other) == fmi2Error && fmi2SetReal(c, outputs, 1, &other) == fmi2Error);
    for (int k = 1; k < 4; k++) NEED(fmi2DoStep(c, k * STEP, STEP, fmi2True) == fmi2OK);
    NEED(fmi2DoStep(c, 4 * STEP, STEP, fmi2True) == fmi2Error);
    fmi2FreeInstance(c);
}

/* 2.5 s on a clock that is off by thousandths of a step. */
static void single_precision(const char *guid, const fmi2CallbackFunctions *callbacks) {
    fmi2Component c = start("single", guid, callbacks, 1.0);
    for (float time = 0.0f; time < 2.5f; time += 1e-4f) NEED(fmi2DoStep(c, time, 1e-4f, fmi2True) == fmi2OK);
    fmi2FreeInstance(c);
}

int main(int count, char **arguments) {
    NEED(count == 3);
    void *library = OPEN(arguments[1]);
    NEED(library);
#define LOAD(name) NEED((name = (name##TYPE *)SYMBOL(library, #name)))
    LOAD(fmi2Instantiate);
    LOAD(fmi2FreeInstance);
    LOAD(fmi2SetupExperiment);
    LOAD(fmi2EnterInitializationMode);
    LOAD(fmi2ExitInitializationMode);
    LOAD(fmi2Terminate);
    LOAD(fmi2SetReal);
    LOAD(fmi2GetReal);
    LOAD(fmi2DoStep);
    LOAD(fmi2GetFMUstate);
    LOAD(fmi2SetFMUstate);
    LOAD(fmi2FreeFMUstate);
    LOAD(fmi2SerializedFMUstateSize);
    LOAD(fmi2SerializeFMUstate);
    LOAD(fmi2DeSerializeFMUstate);

    const fmi2CallbackFunctions callbacks = {logger, calloc, free, NULL, NULL};
    misuse(arguments[2], &callbacks);
    single_precision(arguments[2], &callbacks);
    fmi2Component one = start("one", arguments[2], &callbacks, 1.0);
    fmi2Component other = start("other", arguments[2], &callbacks, 0.8);
    static double ones[STEPS][N_OUTPUTS], others[STEPS][N_OUTPUTS], again[N_OUTPUTS];
    fmi2FMUstate state = NULL, copy = NULL;
    size_t size = 0;
    for (int k = 0; k < STEPS; k++) {
        if (k == STATE_AT) {
            NEED(fmi2GetFMUstate(one, &state) == fmi2OK);
            NEED(fmi2SerializedFMUstateSize(one, state, &size) == fmi2OK);
        }
        step(one, k, 0.2, ones[k]);
        step(other, k, -0.3, others[k]);
    }
    char *bytes = malloc(size);
    NEED(bytes && fmi2SerializeFMUstate(one, state, bytes, size) == fmi2OK);
    NEED(fmi2DeSerializeFMUstate(other, bytes, size, &copy) == fmi2OK);
    free(bytes);
    /* the first instance's state, restored in itself and in the other one: the same bits again */
    NEED(fmi2SetFMUstate(one, state) == fmi2OK && fmi2SetFMUstate(other, copy) == fmi2OK);
    for (int k = STATE_AT; k < STEPS; k++) {
        step(one, k, 0.2, again);
        NEED(memcmp(again, ones[k], sizeof again) == 0);
        step(other, k, 0.2, again);
        NEED(memcmp(again, ones[k], sizeof again) == 0);
    }
    NEED(fmi2FreeFMUstate(one, &state) == fmi2OK && fmi2FreeFMUstate(other, &copy) == fmi2OK && !state && !copy);
    NEED(fmi2Terminate(one) == fmi2OK);
    fmi2FreeInstance(one);
    fmi2FreeInstance(other);
    for (int k = 0; k < STEPS; k++)
        for (int i = 0; i < N_OUTPUTS; i++) {
            uint64_t bits[2];
            memcpy(&bits[0], &ones[k][i], 8);
            memcpy(&bits[1], &others[k][i], 8);
            printf("%016llx %016llx\n", (unsigned long long)bits[0], (unsigned long long)bits[1]);
        }
    return 0;
}
