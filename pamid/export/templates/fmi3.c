/* @NAME@ as an FMU: FMI 3.0, co-simulation. @WHAT@ */
#include "@NAME@.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#if defined _WIN32
#define EXPORT __declspec(dllexport)
#elif defined __GNUC__
#define EXPORT __attribute__((visibility("default")))
#else
#define EXPORT
#endif

#define INSTANCES 64
#define INPUTS 4
#define OUTPUTS (@NAME_UPPER@_OUTPUTS + 3)

enum { OK = 0, FAILED = 3 };

typedef struct {
    bool used;
    double time;
    double x[INPUTS];@INSTANCE@
} Instance;

/* A pool instead of the heap. Making and freeing instances is left to one thread, as importers do. */
static Instance pool[INSTANCES];

static const double starts[INPUTS] = {@STARTS@};

static void reset(Instance *m)
{
    m->time = 0;
    memcpy(m->x, starts, sizeof starts);@RESET@
}

static void outputs(const Instance *m, double out[OUTPUTS])
{
@TAKE@    @NAME@_real y[@NAME_UPPER@_OUTPUTS];
    @NAME@_jet jet;
    int k;
    @NAME@_predict(&s, y, &jet);
    for (k = 0; k < @NAME_UPPER@_OUTPUTS; k++)
        out[k] = y[k];
    out[k] = jet.V;
    out[k + 1] = jet.V_eps;
    out[k + 2] = jet.V_P;
}

EXPORT const char *fmi3GetVersion(void);
EXPORT void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible,
                                         bool logging, bool event_mode, bool early_return, const uint32_t required[],
                                         size_t n_required, void *environment, void (*log)(void), void (*update)(void));
EXPORT void fmi3FreeInstance(void *instance);
EXPORT int fmi3SetDebugLogging(void *instance, bool on, size_t n, const char *const categories[]);
EXPORT int fmi3EnterInitializationMode(void *instance, bool defined, double tolerance, double start, bool stop_defined,
                                       double stop);
EXPORT int fmi3ExitInitializationMode(void *instance);
EXPORT int fmi3EnterStepMode(void *instance);
EXPORT int fmi3Terminate(void *instance);
EXPORT int fmi3Reset(void *instance);
EXPORT int fmi3GetFloat64(void *instance, const uint32_t refs[], size_t n_refs, double values[], size_t n_values);
EXPORT int fmi3SetFloat64(void *instance, const uint32_t refs[], size_t n_refs, const double values[], size_t n_values);
EXPORT int fmi3DoStep(void *instance, double now, double step, bool no_return, bool *event, bool *terminate,
                      bool *early, double *last);

const char *fmi3GetVersion(void)
{
    return "3.0";
}

void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible,
                                  bool logging, bool event_mode, bool early_return, const uint32_t required[],
                                  size_t n_required, void *environment, void (*log)(void), void (*update)(void))
{
    int k;
    (void)name, (void)resources, (void)visible, (void)logging, (void)event_mode, (void)early_return;
    (void)required, (void)n_required, (void)environment, (void)log, (void)update;
    if (!token || strcmp(token, "@TOKEN@"))
        return NULL;
    for (k = 0; k < INSTANCES; k++)
        if (!pool[k].used) {
            pool[k].used = true;
            reset(&pool[k]);
            return &pool[k];
        }
    return NULL;
}

void fmi3FreeInstance(void *instance)
{
    if (instance)
        ((Instance *)instance)->used = false;
}

int fmi3SetDebugLogging(void *instance, bool on, size_t n, const char *const categories[])
{
    (void)instance, (void)on, (void)n, (void)categories;
    return OK;
}

int fmi3EnterInitializationMode(void *instance, bool defined, double tolerance, double start, bool stop_defined,
                                double stop)
{
    (void)defined, (void)tolerance, (void)stop_defined, (void)stop;
    ((Instance *)instance)->time = start;
    return OK;
}

int fmi3ExitInitializationMode(void *instance)
{
    (void)instance;
    return OK;
}

int fmi3EnterStepMode(void *instance)
{
    (void)instance;
    return OK;
}

int fmi3Terminate(void *instance)
{
    (void)instance;
    return OK;
}

int fmi3Reset(void *instance)
{
    reset(instance);
    return OK;
}

/* References: 0 is time, then the inputs, then the outputs, all scalars. */
int fmi3GetFloat64(void *instance, const uint32_t refs[], size_t n_refs, double values[], size_t n_values)
{
    const Instance *m = instance;
    double out[OUTPUTS];
    bool known = false;
    size_t i;
    if (n_refs != n_values)
        return FAILED;
    for (i = 0; i < n_refs; i++)
        if (refs[i] == 0) {
            values[i] = m->time;
        } else if (refs[i] <= INPUTS) {
            values[i] = m->x[refs[i] - 1];
        } else if (refs[i] <= INPUTS + OUTPUTS) {
            if (!known)
                outputs(m, out);
            known = true;
            values[i] = out[refs[i] - 1 - INPUTS];
        } else {
            return FAILED;
        }
    return OK;
}

int fmi3SetFloat64(void *instance, const uint32_t refs[], size_t n_refs, const double values[], size_t n_values)
{
    Instance *m = instance;
    size_t i;
    if (n_refs != n_values)
        return FAILED;
    for (i = 0; i < n_refs; i++) {
        if (refs[i] == 0 || refs[i] > INPUTS)
            return FAILED;
        m->x[refs[i] - 1] = values[i];
    }
    return OK;
}

int fmi3DoStep(void *instance, double now, double step, bool no_return, bool *event, bool *terminate, bool *early,
               double *last)
{
    Instance *m = instance;
    (void)no_return;@STEP@
    m->time = now + step;
    *event = *terminate = *early = false;
    *last = m->time;
    return OK;
}

/* What FMI asks every FMU to export and this one does not offer answers with an error, whatever it is given. */
#define ABSENT(name) \
    EXPORT int fmi3##name(void); \
    int fmi3##name(void) \
    { \
        return FAILED; \
    }
#define ABSENT_INSTANCE(name) \
    EXPORT void *fmi3##name(void); \
    void *fmi3##name(void) \
    { \
        return NULL; \
    }

ABSENT_INSTANCE(InstantiateModelExchange)
ABSENT_INSTANCE(InstantiateScheduledExecution)
@ABSENT@
