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
    if (saved->checksum != checksum(&saved->state) || saved->state.status < 0 || saved->state.status >= N_STATUS)
        return "it is damaged";
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
    if (problem) REFUSE("the serialised FMU state is refused: %s", problem);
    Saved *saved = m->host.allocate(1, sizeof *saved);
    if (!saved) REFUSE("no memory for an FMU state");
    *saved = copy;
    *place = saved;
    return OK;
}
