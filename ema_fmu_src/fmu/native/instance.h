/* One instance of a twin, whatever version of FMI its host speaks.

   An adapter (fmi2.c) translates to it from one version: names, types, status codes, callbacks, and which call is allowed in
   which mode. What is the same in all versions is here, messages included.

   What a host does wrong is refused with a message and changes nothing; the instance works on after it. A twin that has
   failed (mode FAILED) can be reset, restored from a saved state and freed, and its outputs can be read. Nothing is global
   but constants, so that any number of instances run in any number of threads. */

#ifndef INSTANCE_H
#define INSTANCE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#if defined __GNUC__
#define PRINTF(text, first) __attribute__((format(printf, text, first)))
#else
#define PRINTF(text, first)
#endif

typedef enum { /* numbered as the status codes of every version of FMI, so that an adapter's translation costs nothing */
    OK = 0,
    DISCARDED = 2, /* a value was not taken */
    ERROR = 3
} Outcome;

typedef enum { /* where an instance is in its life; bits, so that an adapter can name sets of them */
    INSTANTIATED = 1,
    INITIALIZING = 2,
    RUNNING = 4, /* initialized; a refused step leaves it, for nothing has moved */
    TERMINATED = 8,
    FAILED = 16,
    ANY = 31
} Mode;

typedef struct Instance Instance;
typedef uint32_t Reference; /* FMI's value reference of a variable */
typedef void *SavedState;   /* an instance's state outside it, in memory from its host */

typedef struct Host Host;
struct Host { /* what the host lends an instance; copied into it */
    /* the adapter's way to the host's logger; it may change `text`, which ends with the call */
    void (*log)(const Host *host, const char *instance, Outcome outcome, const char *category, char *text);
    void (*logger)(void); /* the host's own, for `log` to cast and call; NULL: nothing is logged */
    void *environment;    /* for `logger` */
    void *(*allocate)(size_t count, size_t size); /* zeroed, as calloc's */
    void (*release)(void *memory);                /* NULL: the host cannot */
};

/* --- life and logging ----------------------------------------------------------------------------------------------- */

/* An instance called `name`; NULL, and the reason logged, if `given` is not this FMU's identifier, which the adapter's
   version of FMI calls `identifier`. With `verbose` all is logged, without it what goes wrong. */
Instance *instance_create(const Host *host, const char *name, const char *identifier, const char *given, bool verbose);

void instance_free(Instance *m);

/* Back to where instance_create left it; what is logged stays. */
void instance_reset(Instance *m);

/* Times in seconds; NULL for a stop time, or a tolerance, that is not given: then there is none, or it is the default. */
Outcome instance_set_experiment(Instance *m, const double *tolerance, double start, const double *stop);

void instance_enter_initialization(Instance *m);
Outcome instance_exit_initialization(Instance *m);
void instance_terminate(Instance *m);

Mode instance_mode(const Instance *m);

/* Adds categories of messages to those that are logged, or takes them away; n = 0: all. */
Outcome instance_choose_logged(Instance *m, bool on, size_t n, const char *const names[]);

/* Logs why a call ends with `outcome`, and returns that. */
Outcome instance_tell(const Instance *m, Outcome outcome, const char *format, ...) PRINTF(3, 4);

/* Refuses a call that is not allowed in the instance's mode. */
Outcome instance_refuse_in_mode(const Instance *m, const char *function);

/* Logs why there is no instance. */
void host_tell(const Host *host, const char *name, const char *format, ...) PRINTF(3, 4);

/* --- values: a call sets all of its values or none; DISCARDED if one is out of its range --------------------------- */

Outcome instance_get_double(Instance *m, const Reference vr[], size_t n, double value[]); /* Real */
Outcome instance_get_int32(Instance *m, const Reference vr[], size_t n, int32_t value[]); /* Integer */
Outcome instance_get_flag(Instance *m, const Reference vr[], size_t n, int value[]);      /* Boolean */
Outcome instance_set_double(Instance *m, const Reference vr[], size_t n, const double value[]);
Outcome instance_set_int32(Instance *m, const Reference vr[], size_t n, const int32_t value[]);
Outcome instance_set_flag(Instance *m, const Reference vr[], size_t n, const int value[]);

/* Getting or setting Strings: there is no such variable. */
Outcome instance_use_string(const Instance *m, const Reference vr[], size_t n, const void *value);

/* Slopes of Real inputs, per second; they hold for the next step and are zero after it. */
Outcome instance_set_slope(Instance *m, const Reference vr[], size_t n, const double value[]);

/* --- steps ---------------------------------------------------------------------------------------------------------- */

/* From the communication point `time` over `step` [s]; the instance is then at time + step. */
Outcome instance_step(Instance *m, double time, double step);

Outcome instance_last_outcome(const Instance *m); /* of instance_step */
double instance_time(const Instance *m);          /* last communication point [s] */

/* --- state: all that an instance holds, except its name, its host and what is logged -------------------------------- */

/* Saves into *place, or into new memory if *place is NULL. */
Outcome instance_save(const Instance *m, SavedState *place);
Outcome instance_restore(Instance *m, SavedState state);
Outcome instance_free_state(const Instance *m, SavedState *place);
Outcome instance_serialised_size(const Instance *m, SavedState state, size_t *size);
Outcome instance_serialise(const Instance *m, SavedState state, void *bytes, size_t size);
Outcome instance_deserialise(const Instance *m, const void *bytes, size_t size, SavedState *place);

#endif
