/* @NAME@: an FMU (FMI 2.0, co-simulation) around another one, whose library lies in resources/original, with effects
 * at its inputs, outputs, joints and chambers. All calls go through to the original. */
#include <dlfcn.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <math.h>

#define EXPORT __attribute__((visibility("default")))
#define INSTANCES 64
#define INPUTS @INPUTS@
#define OUTPUTS @OUTPUTS@
#define PARAMETERS @PARAMETERS@
#define SUBSTEPS @SUBSTEPS@

typedef double real;
enum { OK = 0, DISCARD = 2, FAILED = 3 };
typedef int (*call)(void *, ...);
typedef int (*reader)(void *, const unsigned[], size_t, double[]);
typedef int (*writer)(void *, const unsigned[], size_t, const double[]);
typedef int (*stepper)(void *, double, double, int);

typedef struct {
    void *library, *own; /* the original and its instance */
    double asked[INPUTS + 1], now;
    int stepped; /* whether it has taken a step, so that outputs may be read before inputs are set */
} Instance;

static Instance pool[INSTANCES];
static const unsigned inputs[INPUTS + 1] = {@INPUT_REFERENCES@};
static const unsigned outputs[OUTPUTS + 1] = {@OUTPUT_REFERENCES@};
static const double starts[INPUTS + 1] = {@INPUT_STARTS@};
static const unsigned parameters[PARAMETERS + 1] = {@PARAMETER_REFERENCES@};
static const double identified[PARAMETERS + 1] = {@PARAMETER_VALUES@};

/* What the inputs u become, y being the outputs, and what sensors read of y. */
static void pushed(double time, const double asked[], const double y[], double u[])
{
    (void)time, (void)asked, (void)y;
@PUSHED@
}

static void read(double y[])
{
    (void)y;
@READ@
}

static call of(const Instance *m, const char *name)
{
    return (call)dlsym(m->library, name);
}

/* The original begins with what was identified; who sets parameters later has the last word. */
static int begun(Instance *m)
{
    memcpy(m->asked, starts, sizeof starts);
    m->stepped = 0;
    return PARAMETERS ? ((writer)of(m, "fmi2SetReal"))(m->own, parameters, PARAMETERS, identified) : OK;
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
    typedef void *(*maker)(const char *, int, const char *, const char *, const void *, int, int);
    char path[4096], inside[4096];
    const char *folder = resources;
    Instance *m = NULL;
    int k;
    if (!resources || strlen(resources) > 3500)
        return NULL;
    if (!strncmp(folder, "file://", 7))
        folder += 7;
    else if (!strncmp(folder, "file:", 5))
        folder += 5;
    for (k = 0; k < INSTANCES && !m; k++)
        if (!pool[k].library)
            m = &pool[k];
    if (!m)
        return NULL;
    k = (int)strlen(folder);
    snprintf(path, sizeof path, "%s%soriginal/%s", folder, k && folder[k - 1] == '/' ? "" : "/", "@LIBRARY@");
    k = (int)strlen(resources);
    snprintf(inside, sizeof inside, "%s%soriginal/resources", resources, k && resources[k - 1] == '/' ? "" : "/");
    m->library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (!m->library)
        return NULL;
    m->own = ((maker)dlsym(m->library, "fmi2Instantiate"))(name, kind, token, inside, calls, visible, logging);
    if (!m->own || begun(m) >= FAILED) {
        dlclose(m->library);
        m->library = NULL;
        return NULL;
    }
    return m;
}

EXPORT void fmi2FreeInstance(void *instance);
void fmi2FreeInstance(void *instance)
{
    Instance *m = instance;
    if (!m || !m->library)
        return;
    ((void (*)(void *))dlsym(m->library, "fmi2FreeInstance"))(m->own);
    dlclose(m->library);
    m->library = NULL;
}

static int refresh(Instance *m, double time)
{
    double y[OUTPUTS + 1], u[INPUTS + 1];
    int status = OK;
    if (OUTPUTS)
        status = ((reader)of(m, "fmi2GetReal"))(m->own, outputs, OUTPUTS, y);
    memcpy(u, m->asked, sizeof u);
    pushed(time, m->asked, y, u);
    if (INPUTS && status < DISCARD)
        status = ((writer)of(m, "fmi2SetReal"))(m->own, inputs, INPUTS, u);
    return status;
}

EXPORT int fmi2SetReal(void *instance, const unsigned refs[], size_t n, const double values[]);
int fmi2SetReal(void *instance, const unsigned refs[], size_t n, const double values[])
{
    Instance *m = instance;
    size_t i;
    int k, asked = 0, status = ((writer)of(m, "fmi2SetReal"))(m->own, refs, n, values);
    for (i = 0; i < n; i++)
        for (k = 0; k < INPUTS; k++)
            if (refs[i] == inputs[k]) {
                m->asked[k] = values[i];
                asked = 1;
            }
    return asked && m->stepped && status < DISCARD ? refresh(m, m->now) : status;
}

EXPORT int fmi2GetReal(void *instance, const unsigned refs[], size_t n, double values[]);
int fmi2GetReal(void *instance, const unsigned refs[], size_t n, double values[])
{
    Instance *m = instance;
    double y[OUTPUTS + 1];
    size_t i;
    int k, status = ((reader)of(m, "fmi2GetReal"))(m->own, refs, n, values);
    if (OUTPUTS && status < DISCARD)
        status = ((reader)of(m, "fmi2GetReal"))(m->own, outputs, OUTPUTS, y);
    read(y);
    for (i = 0; i < n; i++) {
        for (k = 0; k < OUTPUTS; k++)
            if (refs[i] == outputs[k])
                values[i] = y[k];
        for (k = 0; k < INPUTS; k++)
            if (refs[i] == inputs[k])
                values[i] = m->asked[k];
    }
    return status;
}

EXPORT int fmi2DoStep(void *instance, double now, double length, int no_set_back);
int fmi2DoStep(void *instance, double now, double length, int no_set_back)
{
    Instance *m = instance;
    const double part = length / SUBSTEPS;
    int k, status = OK;
    for (k = 0; k < SUBSTEPS && status < DISCARD; k++) {
        status = refresh(m, now + k * part);
        if (status < DISCARD)
            status = ((stepper)of(m, "fmi2DoStep"))(m->own, now + k * part, part, no_set_back);
    }
    m->now = now + length;
    m->stepped = 1;
    return status;
}

EXPORT int fmi2SetupExperiment(void *instance, int defined, double tolerance, double start, int stop_defined,
                               double stop);
int fmi2SetupExperiment(void *instance, int defined, double tolerance, double start, int stop_defined, double stop)
{
    Instance *m = instance;
    typedef int (*beginner)(void *, int, double, double, int, double);
    return ((beginner)of(m, "fmi2SetupExperiment"))(m->own, defined, tolerance, start, stop_defined, stop);
}

EXPORT int fmi2Reset(void *instance);
int fmi2Reset(void *instance)
{
    Instance *m = instance;
    int status = of(m, "fmi2Reset")(m->own);
    return status < DISCARD ? begun(m) : status;
}

#define THROUGH(name) \
    EXPORT int fmi2##name(void *instance); \
    int fmi2##name(void *instance) \
    { \
        return of(instance, "fmi2" #name)(((Instance *)instance)->own); \
    }
THROUGH(EnterInitializationMode)
THROUGH(ExitInitializationMode)
THROUGH(Terminate)
THROUGH(CancelStep)

#define VALUES(name, type) \
    EXPORT int fmi2##name(void *instance, const unsigned refs[], size_t n, type values[]); \
    int fmi2##name(void *instance, const unsigned refs[], size_t n, type values[]) \
    { \
        typedef int (*passer)(void *, const unsigned[], size_t, type[]); \
        return ((passer)of(instance, "fmi2" #name))(((Instance *)instance)->own, refs, n, values); \
    }
VALUES(GetInteger, int)
VALUES(GetBoolean, int)
VALUES(GetString, const char *)
VALUES(SetInteger, const int)
VALUES(SetBoolean, const int)
VALUES(SetString, const char *const)

EXPORT int fmi2SetDebugLogging(void *instance, int on, size_t n, const char *const categories[]);
int fmi2SetDebugLogging(void *instance, int on, size_t n, const char *const categories[])
{
    typedef int (*logger)(void *, int, size_t, const char *const[]);
    return ((logger)of(instance, "fmi2SetDebugLogging"))(((Instance *)instance)->own, on, n, categories);
}

/* What needs to go back in time, or states from outside: effects would not follow. */
#define ABSENT(name) \
    EXPORT int fmi2##name(void); \
    int fmi2##name(void) \
    { \
        return FAILED; \
    }
@ABSENT@
