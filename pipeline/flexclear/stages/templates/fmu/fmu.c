/* An FMU for co-simulation, FMI 2.0 or 3.0 (-DFMI=2 or 3), whose motion a process of flexclear computes.

   The process is started here and talks through a socket.  A request is a letter with numbers; a reply is a byte, 0 and
   the outputs, or 1 and the length and text of an error.  "model.h" has the numbers of inputs NU, parameters NP and
   outputs NY, their START values and the TOKEN.  A value reference is an index: inputs, parameters, outputs, time. */

#include <math.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/types.h>
#include <sys/wait.h>
#include <unistd.h>

#include "model.h"

#define N (NU + NP + NY)
#define API __attribute__((visibility("default")))

enum { OK, WARNING, DISCARD, ERROR, FATAL };
typedef int Status;
typedef void *Component;
typedef unsigned int Ref;

#if FMI == 2
typedef const char *String;
typedef int Bool;
typedef void (*Logger)(void *, String, Status, String, String, ...);
typedef struct { Logger logger; void *allocate, *release, *finished, *environment; } Callbacks;
#else
typedef const char *String;
typedef _Bool Bool;
typedef void (*Logger)(void *, Status, String, String);
#endif

typedef struct {
    int socket, ready, running;
    pid_t child;
    double time, start, stop, values[N + 1], rates[NU + 1];
    unsigned char given[N + 1];
    Logger logger;
    void *environment;
    char *name, *resources;
} Model;

/* a stored state: what the process needs, and the values known here */
typedef struct { uint64_t length; double time, values[N + 1], rates[NU + 1]; unsigned char given[N + 1]; char data[]; } State;

static Status failed(Model *m, const char *text) {
#if FMI == 2
    if (m->logger) m->logger(m->environment, m->name, ERROR, "logStatusError", "%s", text);
#else
    if (m->logger) m->logger(m->environment, ERROR, "logStatusError", text);
#endif
    return ERROR;
}

static int put(Model *m, const void *data, size_t size) {
    const char *at = data;
    while (size) {
        ssize_t sent = send(m->socket, at, size, MSG_NOSIGNAL);
        if (sent <= 0) return 0;
        at += sent, size -= (size_t)sent;
    }
    return 1;
}

static int take(Model *m, void *data, size_t size) {
    char *at = data;
    while (size) {
        ssize_t got = recv(m->socket, at, size, 0);
        if (got <= 0) return 0;
        at += got, size -= (size_t)got;
    }
    return 1;
}

static Status reply(Model *m) {
    unsigned char wrong = 1;
    uint64_t length = 0;
    if (!take(m, &wrong, 1)) return failed(m, "the process of flexclear has ended");
    if (!wrong) return OK;
    if (!take(m, &length, 8) || length > 1 << 20) return failed(m, "the process of flexclear has ended");
    char *text = calloc(length + 1, 1);
    Status status = text && take(m, text, length) ? failed(m, text) : failed(m, "the process of flexclear has ended");
    free(text);
    return status;
}

static Status outputs(Model *m) {
    if (reply(m)) return ERROR;
    return take(m, m->values + NU + NP, NY * sizeof(double)) ? OK : failed(m, "the process of flexclear has ended");
}

static Status ask(Model *m, char letter, const double *numbers, size_t count) {
    if (put(m, &letter, 1) && put(m, numbers, count * sizeof(double))) return OK;
    return failed(m, "the process of flexclear has ended");
}

/* values that have been set since the last step; NAN for the others */
static void fresh(Model *m, int first, int count, double *numbers) {
    for (int k = 0; k < count; k++) numbers[k] = m->given[first + k] ? m->values[first + k] : NAN;
}

static void clear(Model *m) {
    memcpy(m->values, START, sizeof(START));
    memset(m->given, 0, sizeof(m->given));
    for (int k = 0; k <= NU; k++) m->rates[k] = NAN;
    m->time = m->start = 0.0, m->stop = NAN, m->ready = m->running = 0;
}

static void end(Model *m) {
    if (!m) return;
    if (m->socket >= 0) put(m, "Q", 1), close(m->socket);
    if (m->child > 0) waitpid(m->child, NULL, 0);
    free(m->name), free(m->resources), free(m);
}

static Model *begin(String name, String resources, Logger logger, void *environment) {
    int pair[2];
    Model *m = calloc(1, sizeof(Model));
    if (!m) return NULL;
    m->socket = -1, m->logger = logger, m->environment = environment;
    m->name = strdup(name ? name : ""), m->resources = strdup(resources ? resources : "");
    clear(m);
    const char *python = getenv("FLEXCLEAR_PYTHON");
    if (!python || !*python) python = PYTHON;
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair)) { failed(m, "no socket"); end(m); return NULL; }
    m->socket = pair[0];
    m->child = fork();
    if (m->child == 0) {
        dup2(pair[1], 0);
        if (dup2(2, 1) < 0) close(1);
        execlp(python, python, "-c", "from flexclear.stages.fmu import serve; serve()", m->resources, (char *)NULL);
        _exit(127);
    }
    close(pair[1]);
    if (m->child < 0 || reply(m)) { failed(m, "flexclear cannot be started: name its Python in FLEXCLEAR_PYTHON"); end(m); return NULL; }
    return m;
}

static Status initialise(Model *m) {
    double numbers[2 + NP + NU];
    numbers[0] = m->start, numbers[1] = m->stop;
    fresh(m, NU, NP, numbers + 2);
    fresh(m, 0, NU, numbers + 2 + NP);
    m->time = m->start;
    if (ask(m, 'I', numbers, 2 + NP + NU) || outputs(m)) return ERROR;
    m->ready = 1;
    return OK;
}

/* outputs that are read before are those of the values set so far */
static Status begun(Model *m) {
    if (!m->ready && initialise(m)) return ERROR;
    m->running = 1;
    memset(m->given, 0, sizeof(m->given));
    return OK;
}

static Status advance(Model *m, double time, double duration) {
    double numbers[1 + 2 * NU];
    if (!(fabs(time - m->time) <= 1e-6 * fmax(fabs(duration), fabs(m->time)))) {
        char text[120];
        snprintf(text, sizeof text, "a step from %.9g s is asked for, but the motion is at %.9g s: restore a state", time, m->time);
        return failed(m, text);
    }
    numbers[0] = duration;
    fresh(m, 0, NU, numbers + 1);
    for (int k = 0; k < NU; k++) numbers[1 + NU + k] = m->rates[k], m->rates[k] = NAN;
    memset(m->given, 0, sizeof(m->given));
    if (ask(m, 'A', numbers, 1 + 2 * NU) || outputs(m)) return ERROR;
    m->time += duration;
    return OK;
}

static Status get(Model *m, const Ref *refs, size_t count, double *values) {
    for (size_t k = 0; k < count; k++) {
        if (refs[k] > N) return failed(m, "there is no such variable");
        if (refs[k] >= NU + NP && refs[k] < N && !m->ready && initialise(m)) return ERROR;
        values[k] = refs[k] == N ? m->time : m->values[refs[k]];
    }
    return OK;
}

static Status set(Model *m, const Ref *refs, size_t count, const double *values) {
    for (size_t k = 0; k < count; k++) {
        if (refs[k] >= NU + NP) return failed(m, "only inputs and parameters can be set");
        if (!isfinite(values[k])) return failed(m, "a value is not a finite number");
        if (m->running && refs[k] >= NU) return failed(m, "parameters are set before the start");
        m->values[refs[k]] = values[k], m->given[refs[k]] = 1;
        m->ready = m->running;
    }
    return OK;
}

static Status keep(Model *m, void **state) {
    uint64_t length;
    if (ask(m, 'S', NULL, 0) || reply(m)) return ERROR;
    if (!take(m, &length, 8)) return failed(m, "the process of flexclear has ended");
    State *made = malloc(sizeof(State) + length);
    if (!made) return failed(m, "no memory for the state");
    if (!take(m, made->data, length)) { free(made); return failed(m, "the process of flexclear has ended"); }
    made->length = length, made->time = m->time;
    memcpy(made->values, m->values, sizeof(m->values)), memcpy(made->rates, m->rates, sizeof(m->rates));
    memcpy(made->given, m->given, sizeof(m->given));
    free(*state);
    *state = made;
    return OK;
}

static Status put_back(Model *m, State *state) {
    double now[N + 1];
    if (!state) return failed(m, "there is no such state");
    if (ask(m, 'R', NULL, 0) || !put(m, &state->length, 8) || !put(m, state->data, state->length)) return ERROR;
    memcpy(now, state->values, sizeof(now));
    if (outputs(m)) return ERROR;
    memcpy(m->values, now, sizeof(now)), memcpy(m->rates, state->rates, sizeof(m->rates));
    memcpy(m->given, state->given, sizeof(m->given));
    m->time = state->time;
    return OK;
}

static Status unpack(Model *m, const char *bytes, size_t size, void **state) {
    State head;
    if (size < sizeof(State)) return failed(m, "the state is damaged");
    memcpy(&head, bytes, sizeof(State));
    if (head.length != size - sizeof(State)) return failed(m, "the state is damaged");
    State *made = malloc(size);
    if (!made) return failed(m, "no memory for the state");
    memcpy(made, bytes, size);
    free(*state);
    *state = made;
    return OK;
}

#define EXPECT(condition) if (!(condition)) return ERROR

#if FMI == 2
API String fmi2GetTypesPlatform(void) { return "default"; }
API String fmi2GetVersion(void) { return "2.0"; }
API Status fmi2SetDebugLogging(Component c, Bool on, size_t n, const String *names) { return OK; }
API Component fmi2Instantiate(String name, int kind, String token, String resources, const Callbacks *f, Bool visible, Bool log) {
    if (kind != 1 || !token || strcmp(token, TOKEN)) return NULL;
    return begin(name, resources, f ? f->logger : NULL, f ? f->environment : NULL);
}
API void fmi2FreeInstance(Component c) { end(c); }
API Status fmi2SetupExperiment(Component c, Bool tolerant, double tolerance, double start, Bool stops, double stop) {
    Model *m = c;
    m->time = m->start = start, m->stop = stops ? stop : NAN;
    return OK;
}
API Status fmi2EnterInitializationMode(Component c) { return OK; }
API Status fmi2ExitInitializationMode(Component c) { return begun(c); }
API Status fmi2Terminate(Component c) { return OK; }
API Status fmi2Reset(Component c) { clear(c); return OK; }
API Status fmi2GetReal(Component c, const Ref *r, size_t n, double *v) { return get(c, r, n, v); }
API Status fmi2SetReal(Component c, const Ref *r, size_t n, const double *v) { return set(c, r, n, v); }
API Status fmi2GetInteger(Component c, const Ref *r, size_t n, int *v) { return n ? ERROR : OK; }
API Status fmi2SetInteger(Component c, const Ref *r, size_t n, const int *v) { return n ? ERROR : OK; }
API Status fmi2GetBoolean(Component c, const Ref *r, size_t n, Bool *v) { return n ? ERROR : OK; }
API Status fmi2SetBoolean(Component c, const Ref *r, size_t n, const Bool *v) { return n ? ERROR : OK; }
API Status fmi2GetString(Component c, const Ref *r, size_t n, String *v) { return n ? ERROR : OK; }
API Status fmi2SetString(Component c, const Ref *r, size_t n, const String *v) { return n ? ERROR : OK; }
API Status fmi2GetFMUstate(Component c, void **s) { return keep(c, s); }
API Status fmi2SetFMUstate(Component c, void *s) { return put_back(c, s); }
API Status fmi2FreeFMUstate(Component c, void **s) { free(*s); *s = NULL; return OK; }
API Status fmi2SerializedFMUstateSize(Component c, void *s, size_t *n) { *n = sizeof(State) + ((State *)s)->length; return OK; }
API Status fmi2SerializeFMUstate(Component c, void *s, char *b, size_t n) { memcpy(b, s, n); return OK; }
API Status fmi2DeSerializeFMUstate(Component c, const char *b, size_t n, void **s) { return unpack(c, b, n, s); }
API Status fmi2GetDirectionalDerivative(Component c, const Ref *u, size_t nu, const Ref *k, size_t nk, const double *d, double *v) { return ERROR; }
API Status fmi2SetRealInputDerivatives(Component c, const Ref *r, size_t n, const int *order, const double *v) {
    for (size_t k = 0; k < n; k++) {
        if (r[k] >= NU || order[k] != 1 || !isfinite(v[k])) return failed(c, "only first derivatives of inputs can be set");
        ((Model *)c)->rates[r[k]] = v[k];
    }
    return OK;
}
API Status fmi2GetRealOutputDerivatives(Component c, const Ref *r, size_t n, const int *order, double *v) { return ERROR; }
API Status fmi2DoStep(Component c, double time, double duration, Bool final) { return advance(c, time, duration); }
API Status fmi2CancelStep(Component c) { return ERROR; }
API Status fmi2GetStatus(Component c, int kind, Status *v) { return DISCARD; }
API Status fmi2GetRealStatus(Component c, int kind, double *v) { if (kind != 2) return DISCARD; *v = ((Model *)c)->time; return OK; }
API Status fmi2GetIntegerStatus(Component c, int kind, int *v) { return DISCARD; }
API Status fmi2GetBooleanStatus(Component c, int kind, Bool *v) { return DISCARD; }
API Status fmi2GetStringStatus(Component c, int kind, String *v) { return DISCARD; }
#else
API String fmi3GetVersion(void) { return "3.0"; }
API Status fmi3SetDebugLogging(Component c, Bool on, size_t n, const String *names) { return OK; }
API Component fmi3InstantiateModelExchange(String a, String b, String r, Bool v, Bool l, void *e, Logger g) { return NULL; }
API Component fmi3InstantiateScheduledExecution(String a, String b, String r, Bool v, Bool l, void *e, Logger g, void *t, void *k, void *u) { return NULL; }
API Component fmi3InstantiateCoSimulation(String name, String token, String resources, Bool visible, Bool log, Bool events,
                                          Bool early, const Ref *refs, size_t n, void *environment, Logger logger, void *update) {
    if (!token || strcmp(token, TOKEN)) return NULL;
    return begin(name, resources, logger, environment);
}
API void fmi3FreeInstance(Component c) { end(c); }
API Status fmi3EnterInitializationMode(Component c, Bool tolerant, double tolerance, double start, Bool stops, double stop) {
    Model *m = c;
    m->time = m->start = start, m->stop = stops ? stop : NAN;
    return OK;
}
API Status fmi3ExitInitializationMode(Component c) { return begun(c); }
API Status fmi3EnterEventMode(Component c) { return ERROR; }
API Status fmi3Terminate(Component c) { return OK; }
API Status fmi3Reset(Component c) { clear(c); return OK; }
API Status fmi3GetFloat64(Component c, const Ref *r, size_t n, double *v, size_t nv) { EXPECT(n == nv); return get(c, r, n, v); }
API Status fmi3SetFloat64(Component c, const Ref *r, size_t n, const double *v, size_t nv) { EXPECT(n == nv); return set(c, r, n, v); }
#define FAMILY(name, type)                                                                                             \
    API Status fmi3Get##name(Component c, const Ref *r, size_t n, type *v, size_t nv) { return n ? ERROR : OK; }       \
    API Status fmi3Set##name(Component c, const Ref *r, size_t n, const type *v, size_t nv) { return n ? ERROR : OK; }
FAMILY(Float32, float) FAMILY(Int8, int8_t) FAMILY(UInt8, uint8_t) FAMILY(Int16, int16_t) FAMILY(UInt16, uint16_t)
FAMILY(Int32, int32_t) FAMILY(UInt32, uint32_t) FAMILY(Int64, int64_t) FAMILY(UInt64, uint64_t) FAMILY(Boolean, Bool)
FAMILY(String, String)
API Status fmi3GetBinary(Component c, const Ref *r, size_t n, size_t *s, const uint8_t **v, size_t nv) { return n ? ERROR : OK; }
API Status fmi3SetBinary(Component c, const Ref *r, size_t n, const size_t *s, const uint8_t *const *v, size_t nv) { return n ? ERROR : OK; }
API Status fmi3GetClock(Component c, const Ref *r, size_t n, Bool *v) { return n ? ERROR : OK; }
API Status fmi3SetClock(Component c, const Ref *r, size_t n, const Bool *v) { return n ? ERROR : OK; }
API Status fmi3GetFMUState(Component c, void **s) { return keep(c, s); }
API Status fmi3SetFMUState(Component c, void *s) { return put_back(c, s); }
API Status fmi3FreeFMUState(Component c, void **s) { free(*s); *s = NULL; return OK; }
API Status fmi3SerializedFMUStateSize(Component c, void *s, size_t *n) { *n = sizeof(State) + ((State *)s)->length; return OK; }
API Status fmi3SerializeFMUState(Component c, void *s, uint8_t *b, size_t n) { memcpy(b, s, n); return OK; }
API Status fmi3DeserializeFMUState(Component c, const uint8_t *b, size_t n, void **s) { return unpack(c, (const char *)b, n, s); }
API Status fmi3DoStep(Component c, double time, double duration, Bool final, Bool *event, Bool *ended, Bool *early, double *last) {
    Status status = advance(c, time, duration);
    *event = *ended = *early = 0, *last = ((Model *)c)->time;
    return status;
}
API Status fmi3EnterStepMode(Component c) { return ERROR; }
API Status fmi3EnterConfigurationMode(Component c) { return ERROR; }
API Status fmi3ExitConfigurationMode(Component c) { return ERROR; }
API Status fmi3GetOutputDerivatives(Component c, const Ref *r, size_t n, const int *order, double *v, size_t nv) { return ERROR; }
#define NONE(name) API Status fmi3##name(void) { return ERROR; }
NONE(GetNumberOfVariableDependencies) NONE(GetVariableDependencies) NONE(GetDirectionalDerivative)
NONE(GetAdjointDerivative) NONE(GetIntervalDecimal) NONE(GetIntervalFraction) NONE(GetShiftDecimal) NONE(GetShiftFraction)
NONE(SetIntervalDecimal) NONE(SetIntervalFraction) NONE(SetShiftDecimal) NONE(SetShiftFraction) NONE(EvaluateDiscreteStates)
NONE(UpdateDiscreteStates) NONE(EnterContinuousTimeMode) NONE(CompletedIntegratorStep) NONE(SetTime)
NONE(SetContinuousStates) NONE(GetContinuousStateDerivatives) NONE(GetEventIndicators) NONE(GetContinuousStates)
NONE(GetNominalsOfContinuousStates) NONE(GetNumberOfEventIndicators) NONE(GetNumberOfContinuousStates)
NONE(ActivateModelPartition)
#endif
