/* An instance's state outside it: saved, restored, as bytes; foreign and damaged ones are refused. */

#include <string.h>

#include "layout.h"

/* A state outside the instance, in memory and as bytes alike; the layout is the same on every platform. */
typedef struct {
    char magic[8];
    uint64_t size;
    char guid[40];
    uint64_t checksum; /* FNV-1a, 64 bits, over `state` */
    State state;
} Saved;

_Static_assert(sizeof GUID <= sizeof((Saved *)0)->guid, "the GUID has its place in a saved state");

static const char MAGIC[8] = "EMAtwin";

static uint64_t checksum(const State *s) {
    const unsigned char *bytes = (const unsigned char *)s;
    uint64_t sum = 14695981039346656037u;
    for (size_t i = 0; i < sizeof *s; i++) sum = (sum ^ bytes[i]) * 1099511628211u;
    return sum;
}

/* Why `saved` is no state of this FMU; NULL if it is one. */
static const char *foreign(const Saved *saved) {
    if (!saved) return "it is null";
    if (memcmp(saved->magic, MAGIC, sizeof MAGIC) != 0 || saved->size != sizeof *saved)
        return "it is none of this software's";
    if (strncmp(saved->guid, GUID, sizeof saved->guid) != 0) return "it is of another FMU";
    if (saved->checksum != checksum(&saved->state)) return "it is damaged";
    return NULL;
}

static bool all_finite(const double values[], size_t n) {
    for (size_t i = 0; i < n; i++)
        if (!isfinite(values[i])) return false;
    return true;
}

static bool is_count(double value, double least, double most) {
    return value >= least && value <= most && value == (double)(int64_t)value;
}

/* Whether a twin that has started could have such a clock: a step of it ends, and ends where its host wants it. */
static bool is_clock(const State *s) {
    static const double MOST_TICKS = 0x1p52; /* a double counts to twice as many */
    const double *x = s->x, step = x[CLOCK_STEP], tick = TICK_LENGTH(s), point = x[CLOCK_POINT];
    if (!(step > 0.0 && is_count(x[CLOCK_PER_SAMPLE], 1.0, INT32_MAX) && is_count(x[CLOCK_TICK], 0.0, MOST_TICKS)))
        return false;
    if (!(step <= tick * (1.0 + 1e-9) && step * x[CLOCK_PER_SAMPLE] >= tick * (1.0 - 1e-9))) return false;
    if (!is_count(x[CLOCK_NEXT_SAMPLE] - x[CLOCK_TICK], 0.0, x[CLOCK_PER_SAMPLE])) return false;
    if (!is_count(x[CLOCK_PENDING], 0.0, 1.0) || !is_count(x[CLOCK_RAMPED], 0.0, 1.0))
        return false;
    const double behind = point - (x[CLOCK_TICK] * tick + x[CLOCK_OFFSET]), close = 1e-3 * tick + 0x1p-50 * point;
    return point == s->point - s->start && x[CLOCK_OFFSET] >= -close && x[CLOCK_OFFSET] <= tick + close &&
           behind >= -close && behind <= tick + close;
}

/* Why no instance can have got into the state; NULL if one can. Who forges a state must not make a call hang. */
static const char *unsound(const State *s) {
    const int mode = s->mode;
    if (mode != INSTANTIATED && mode != INITIALIZING && mode != RUNNING && mode != TERMINATED && mode != FAILED)
        return "it has no mode";
    if (s->status < 0 || s->status >= N_STATUS || s->fresh < 0 || s->fresh > 1 || (s->last != OK && s->last != ERROR))
        return "it has no status";
    if (!(isfinite(s->start) && isfinite(s->point) && s->point >= s->start && s->stop >= s->start))
        return "its times are none";
    if (!(s->tolerance > 0.0 && isfinite(s->tolerance))) return "its tolerance is none";
    for (size_t i = 0; i < N_INPUTS; i++)
        if (!isfinite(s->slope[i]) || (s->slope[i] != 0.0 && !s->ramps) || s->x[SLOPE_OF[i]] != 0.0)
            return "its slopes are none";
    for (size_t i = 0; i < N_VARIABLES; i++)
        if (is_settable(&VARIABLES[i]) &&
            !(in_range(&VARIABLES[i], s->v[i]) && (KIND_OF[i] == REAL || is_count(s->v[i], INT32_MIN, INT32_MAX))))
            return "a variable is out of its range";
    if (mode == RUNNING || mode == TERMINATED) {
        if (!all_finite(s->v, N_VARIABLES) || !all_finite(s->x, N_STATES)) return "a number in it is not finite";
        if (!is_clock(s)) return "its clock is none";
    }
    return NULL;
}

#define REFUSE_FOREIGN(saved)                                                                                      \
    do {                                                                                                           \
        const char *problem = foreign(saved);                                                                      \
        if (problem) REFUSE("the FMU state is refused: %s; nothing changed", problem);                             \
    } while (0)

Outcome instance_save(const Instance *m, SavedState *place) {
    if (!place) REFUSE("the place for the FMU state is null");
    Saved *saved = *place;
    if (saved) REFUSE_FOREIGN(saved);
    if (!saved && !(saved = m->host.allocate(1, sizeof *saved))) REFUSE("no memory for an FMU state");
    memcpy(saved->magic, MAGIC, sizeof MAGIC);
    saved->size = sizeof *saved;
    memcpy(saved->guid, GUID, sizeof GUID);
    saved->state = m->state;
    saved->checksum = checksum(&saved->state);
    *place = saved;
    return OK;
}

Outcome instance_restore(Instance *m, SavedState state) {
    const Saved *saved = state;
    REFUSE_FOREIGN(saved);
    const char *problem = unsound(&saved->state);
    if (problem) REFUSE("the FMU state is refused: %s; nothing changed", problem);
    m->state = saved->state;
    return OK;
}

Outcome instance_free_state(const Instance *m, SavedState *place) {
    if (!place || !*place) return OK;
    REFUSE_FOREIGN(*place);
    memset(*place, 0, sizeof(Saved)); /* a second use of the memory is refused, if the host has not reused it */
    if (m->host.release) m->host.release(*place);
    *place = NULL;
    return OK;
}

Outcome instance_serialised_size(const Instance *m, SavedState state, size_t *size) {
    if (!state || !size) REFUSE("the FMU state or the place for its size is null");
    *size = sizeof(Saved);
    return OK;
}

Outcome instance_serialise(const Instance *m, SavedState state, void *bytes, size_t size) {
    REFUSE_FOREIGN(state);
    if (!bytes) REFUSE("the place for the serialised FMU state is null");
    if (size < sizeof(Saved)) REFUSE("%zu bytes for the serialised FMU state, %zu are needed", size, sizeof(Saved));
    memcpy(bytes, state, sizeof(Saved));
    return OK;
}

Outcome instance_deserialise(const Instance *m, const void *bytes, size_t size, SavedState *place) {
    if (!bytes || !place) REFUSE("the serialised FMU state or the place for the state is null");
    if (size < sizeof(Saved))
        REFUSE("the serialised FMU state is refused: it has %zu bytes, %zu are needed", size, sizeof(Saved));
    Saved copy;
    memcpy(&copy, bytes, sizeof copy);
    const char *problem = foreign(&copy);
    if (!problem) problem = unsound(&copy.state);
    if (problem) REFUSE("the serialised FMU state is refused: %s", problem);
    Saved *saved = m->host.allocate(1, sizeof *saved);
    if (!saved) REFUSE("no memory for an FMU state");
    *saved = copy;
    *place = saved;
    return OK;
}
