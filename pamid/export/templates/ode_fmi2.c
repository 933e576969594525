/* @NAME@ as an FMU: FMI 2.0, co-simulation and model exchange. Ordinary differential equations in formulas. */
#include <math.h>
#include <stddef.h>
#include <string.h>

#if defined _WIN32
#define EXPORT __declspec(dllexport)
#elif defined __GNUC__
#define EXPORT __attribute__((visibility("default")))
#else
#define EXPORT
#endif

#define INSTANCES 64
#define STATES @STATES@
#define INPUTS @INPUTS@
#define PARAMETERS @PARAMETERS@
#define OUTPUTS @OUTPUTS@
#define GIVEN (1 + STATES + INPUTS + PARAMETERS)
#define SUBSTEPS @SUBSTEPS@

typedef double real;
enum { OK = 0, FAILED = 3 };

typedef struct {
    int used;
    double v[GIVEN]; /* time, states, inputs, parameters */
} Instance;

/* A pool instead of the heap. Making and freeing instances is left to one thread, as importers do. */
static Instance pool[INSTANCES];

static const double starts[GIVEN] = {@STARTS@};

/* Rates of the states, then the outputs. */
static void formulas(const double v[GIVEN], double out[STATES + OUTPUTS + 1])
{
@FORMULAS@
}

EXPORT const char *fmi2GetTypesPlatform(void);
const char *fmi2GetTypesPlatform(void)
{
    return "default";
}

EXPORT const char *fmi2GetVersion(void);
const char *fmi2GetVersion(void)
{
    return "2.0";
}

EXPORT void *fmi2Instantiate(const char *name, int kind, const char *token, const char *resources, const void *calls,
                             int visible, int logging);
void *fmi2Instantiate(const char *name, int kind, const char *token, const char *resources, const void *calls,
                      int visible, int logging)
{
    int k;
    (void)name, (void)kind, (void)resources, (void)calls, (void)visible, (void)logging;
    if (!token || strcmp(token, "@TOKEN@"))
        return NULL;
    for (k = 0; k < INSTANCES; k++)
        if (!pool[k].used) {
            pool[k].used = 1;
            memcpy(pool[k].v, starts, sizeof starts);
            return &pool[k];
        }
    return NULL;
}

EXPORT void fmi2FreeInstance(void *instance);
void fmi2FreeInstance(void *instance)
{
    if (instance)
        ((Instance *)instance)->used = 0;
}

EXPORT int fmi2SetupExperiment(void *instance, int defined, double tolerance, double start, int stop_defined,
                               double stop);
int fmi2SetupExperiment(void *instance, int defined, double tolerance, double start, int stop_defined, double stop)
{
    (void)defined, (void)tolerance, (void)stop_defined, (void)stop;
    ((Instance *)instance)->v[0] = start;
    return OK;
}

EXPORT int fmi2Reset(void *instance);
int fmi2Reset(void *instance)
{
    memcpy(((Instance *)instance)->v, starts, sizeof starts);
    return OK;
}

/* References: time, states, inputs, parameters, rates of the states, outputs. */
EXPORT int fmi2GetReal(void *instance, const unsigned refs[], size_t n, double values[]);
int fmi2GetReal(void *instance, const unsigned refs[], size_t n, double values[])
{
    const Instance *m = instance;
    double out[STATES + OUTPUTS + 1];
    size_t i;
    int known = 0;
    for (i = 0; i < n; i++)
        if (refs[i] < GIVEN) {
            values[i] = m->v[refs[i]];
        } else if (refs[i] < GIVEN + STATES + OUTPUTS) {
            if (!known)
                formulas(m->v, out);
            known = 1;
            values[i] = out[refs[i] - GIVEN];
        } else {
            return FAILED;
        }
    return OK;
}

EXPORT int fmi2SetReal(void *instance, const unsigned refs[], size_t n, const double values[]);
int fmi2SetReal(void *instance, const unsigned refs[], size_t n, const double values[])
{
    size_t i;
    for (i = 0; i < n; i++) {
        if (refs[i] == 0 || refs[i] >= GIVEN)
            return FAILED;
        ((Instance *)instance)->v[refs[i]] = values[i];
    }
    return OK;
}

/* --- model exchange --------------------------------------------------------------------------------------- */
EXPORT int fmi2SetTime(void *instance, double time);
int fmi2SetTime(void *instance, double time)
{
    ((Instance *)instance)->v[0] = time;
    return OK;
}

EXPORT int fmi2SetContinuousStates(void *instance, const double x[], size_t n);
int fmi2SetContinuousStates(void *instance, const double x[], size_t n)
{
    memcpy(((Instance *)instance)->v + 1, x, n * sizeof *x);
    return OK;
}

EXPORT int fmi2GetContinuousStates(void *instance, double x[], size_t n);
int fmi2GetContinuousStates(void *instance, double x[], size_t n)
{
    memcpy(x, ((Instance *)instance)->v + 1, n * sizeof *x);
    return OK;
}

EXPORT int fmi2GetNominalsOfContinuousStates(void *instance, double x[], size_t n);
int fmi2GetNominalsOfContinuousStates(void *instance, double x[], size_t n)
{
    size_t i;
    (void)instance;
    for (i = 0; i < n; i++)
        x[i] = 1.0;
    return OK;
}

EXPORT int fmi2GetDerivatives(void *instance, double rates[], size_t n);
int fmi2GetDerivatives(void *instance, double rates[], size_t n)
{
    double out[STATES + OUTPUTS + 1];
    formulas(((Instance *)instance)->v, out);
    memcpy(rates, out, n * sizeof *rates);
    return OK;
}

EXPORT int fmi2GetEventIndicators(void *instance, double z[], size_t n);
int fmi2GetEventIndicators(void *instance, double z[], size_t n)
{
    (void)instance, (void)z;
    return n ? FAILED : OK;
}

typedef struct {
    int wanted, terminate, nominals_changed, values_changed, next_defined;
    double next;
} Events;

EXPORT int fmi2NewDiscreteStates(void *instance, Events *e);
int fmi2NewDiscreteStates(void *instance, Events *e)
{
    (void)instance;
    memset(e, 0, sizeof *e);
    return OK;
}

EXPORT int fmi2CompletedIntegratorStep(void *instance, int no_return, int *event, int *terminate);
int fmi2CompletedIntegratorStep(void *instance, int no_return, int *event, int *terminate)
{
    (void)instance, (void)no_return;
    *event = *terminate = 0;
    return OK;
}

/* --- co-simulation: the classical Runge-Kutta method, inputs held over a step -------------------------------- */
static void step(Instance *m, double h)
{
    double x[STATES + 1], k[4][STATES + OUTPUTS + 1];
    static const double at[4] = {0.0, 0.5, 0.5, 1.0};
    const double t = m->v[0];
    int i, j;
    memcpy(x, m->v + 1, STATES * sizeof *x);
    for (j = 0; j < 4; j++) {
        m->v[0] = t + at[j] * h;
        for (i = 0; j && i < STATES; i++)
            m->v[1 + i] = x[i] + at[j] * h * k[j - 1][i];
        formulas(m->v, k[j]);
    }
    for (i = 0; i < STATES; i++)
        m->v[1 + i] = x[i] + h / 6.0 * (k[0][i] + 2.0 * k[1][i] + 2.0 * k[2][i] + k[3][i]);
    m->v[0] = t + h;
}

EXPORT int fmi2DoStep(void *instance, double now, double length, int no_set_back);
int fmi2DoStep(void *instance, double now, double length, int no_set_back)
{
    Instance *m = instance;
    int i;
    (void)no_set_back;
    m->v[0] = now;
    for (i = 0; i < SUBSTEPS; i++)
        step(m, length / SUBSTEPS);
    for (i = 0; i < STATES; i++)
        if (!(m->v[1 + i] - m->v[1 + i] == 0.0)) /* neither a number nor finite */
            return FAILED;
    return OK;
}

#define NOTHING(name) \
    EXPORT int fmi2##name(void *instance); \
    int fmi2##name(void *instance) \
    { \
        (void)instance; \
        return OK; \
    }
NOTHING(EnterInitializationMode)
NOTHING(ExitInitializationMode)
NOTHING(Terminate)
NOTHING(EnterEventMode)
NOTHING(EnterContinuousTimeMode)
NOTHING(SetDebugLogging)

/* What FMI asks every FMU to export and this one does not offer answers with an error, whatever it is given. */
#define ABSENT(name) \
    EXPORT int fmi2##name(void); \
    int fmi2##name(void) \
    { \
        return FAILED; \
    }
@ABSENT@
