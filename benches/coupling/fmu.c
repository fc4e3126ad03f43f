/* Two co-simulation FMUs of FMI 2.0 in one source, as small as can be: what a communication step costs
   beyond them is the master's. With INTEGRATOR dy/dt = u, else u = 2 (1 - y). Value reference 0 is the
   input, 1 the output, 2 and above repeat it (for runs that record more signals). */
#include <stdlib.h>
#include <stddef.h>

typedef struct {
    double input, output;
} Component;

typedef const char *String;

static void calculate(Component *s, double h) {
#ifdef INTEGRATOR
    s->output += h * s->input;
#else
    (void)h;
    s->output = 2.0 * (1.0 - s->input);
#endif
}

const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }
int fmi2SetDebugLogging(void *c, int on, size_t n, const String categories[]) { return 0; }
void *fmi2Instantiate(String name, int type, String guid, String resources, const void *callbacks,
                      int visible, int logging) {
    return calloc(1, sizeof(Component));
}
void fmi2FreeInstance(void *c) { free(c); }
int fmi2SetupExperiment(void *c, int has_tolerance, double tolerance, double start, int has_stop,
                        double stop) { return 0; }
int fmi2EnterInitializationMode(void *c) { calculate(c, 0.0); return 0; }
int fmi2ExitInitializationMode(void *c) { calculate(c, 0.0); return 0; }
int fmi2Terminate(void *c) { return 0; }
int fmi2Reset(void *c) { Component *s = c; s->input = s->output = 0.0; return 0; }
int fmi2GetReal(void *c, const unsigned vr[], size_t n, double values[]) {
    Component *s = c;
    for (size_t i = 0; i < n; i++) values[i] = vr[i] == 0 ? s->input : s->output;
    return 0;
}
int fmi2SetReal(void *c, const unsigned vr[], size_t n, const double values[]) {
    Component *s = c;
    for (size_t i = 0; i < n; i++) {
        if (vr[i] != 0) return 3;
        s->input = values[i];
    }
    return 0;
}
int fmi2DoStep(void *c, double t, double h, int no_set_prior) { calculate(c, h); return 0; }

/* The rest of the interface: nothing of these types, nothing to save. */
int fmi2GetInteger(void *c, const unsigned vr[], size_t n, int v[]) { return n ? 3 : 0; }
int fmi2GetBoolean(void *c, const unsigned vr[], size_t n, int v[]) { return n ? 3 : 0; }
int fmi2GetString(void *c, const unsigned vr[], size_t n, String v[]) { return n ? 3 : 0; }
int fmi2SetInteger(void *c, const unsigned vr[], size_t n, const int v[]) { return n ? 3 : 0; }
int fmi2SetBoolean(void *c, const unsigned vr[], size_t n, const int v[]) { return n ? 3 : 0; }
int fmi2SetString(void *c, const unsigned vr[], size_t n, const String v[]) { return n ? 3 : 0; }
int fmi2GetFMUstate(void *c, void **state) { return 3; }
int fmi2SetFMUstate(void *c, void *state) { return 3; }
int fmi2FreeFMUstate(void *c, void **state) { return 3; }
int fmi2SerializedFMUstateSize(void *c, void *state, size_t *size) { return 3; }
int fmi2SerializeFMUstate(void *c, void *state, char bytes[], size_t size) { return 3; }
int fmi2DeSerializeFMUstate(void *c, const char bytes[], size_t size, void **state) { return 3; }
int fmi2GetDirectionalDerivative(void *c, const unsigned u[], size_t n, const unsigned k[], size_t m,
                                 const double seed[], double result[]) { return 3; }
int fmi2SetRealInputDerivatives(void *c, const unsigned vr[], size_t n, const int order[],
                                const double v[]) { return 3; }
int fmi2GetRealOutputDerivatives(void *c, const unsigned vr[], size_t n, const int order[],
                                 double v[]) { return 3; }
int fmi2CancelStep(void *c) { return 3; }
int fmi2GetStatus(void *c, int kind, int *v) { return 1; }
int fmi2GetRealStatus(void *c, int kind, double *v) { return 1; }
int fmi2GetIntegerStatus(void *c, int kind, int *v) { return 1; }
int fmi2GetBooleanStatus(void *c, int kind, int *v) { return 1; }
int fmi2GetStringStatus(void *c, int kind, String *v) { return 1; }
