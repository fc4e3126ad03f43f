/* The functions of FMI 2.0 (FMI 2.0.5, sections 2.1, 3.2 and 4.2), declared here: no header of the standard is needed.
 * Where several FMUs are linked together, FMI2_FUNCTION_PREFIX is defined for each, usually as the name of the model and
 * an underscore (section 2.1.1); in a library of its own the names have no prefix. */

#define PASTE_(a, b) a##b
#define PASTE(a, b) PASTE_(a, b)
#if defined(FMI2_FUNCTION_PREFIX) && !defined(FMI2_OVERRIDE_FUNCTION_PREFIX)
#define FMI(name) PASTE(FMI2_FUNCTION_PREFIX, fmi2##name)
#else
#define FMI(name) fmi2##name
#endif

#if defined(_WIN32) || defined(__CYGWIN__)
#define EXPORT __declspec(dllexport)
#elif defined(__GNUC__)
#define EXPORT __attribute__((visibility("default")))
#else
#define EXPORT
#endif

typedef void (*Logger)(void *, const char *, int, const char *, const char *, ...);

typedef struct {
    Logger logger;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*step_finished)(void *, int);
    void *environment;
} Callbacks;

typedef struct {
    int new_discrete_states_needed, terminate, nominals_changed, values_changed, next_event_time_defined;
    double next_event_time;
} EventInfo;

/* Doubles what a message, which is a format, must not have alone. */
static void send(Instance *m, int status, const char *category, const char *message)
{
    char text[1700];
    size_t n = 0;
    if (!m->logger) return;
    for (; *message && n < sizeof text - 2; message++) {
        if (*message == '%' || *message == '#') text[n++] = *message;
        text[n++] = *message;
    }
    text[n] = 0;
    ((Logger)m->logger)(m->environment, m->name, status, category, text);
}

static int phase_of(int state)
{
    if (state == S_Instantiated || state == S_InitializationMode) return AT_START;
    return state == S_ContinuousTimeMode ? CONTINUOUS : AT_EVENT;
}

#define VERSION "fmi2"

EXPORT const char *FMI(GetTypesPlatform)(void);
EXPORT const char *FMI(GetTypesPlatform)(void) { return "default"; }

EXPORT const char *FMI(GetVersion)(void);
EXPORT const char *FMI(GetVersion)(void) { return "2.0"; }

EXPORT void *FMI(Instantiate)(const char *, int, const char *, const char *, const Callbacks *, int, int);
EXPORT void *FMI(Instantiate)(const char *name, int type, const char *guid, const char *resources,
                              const Callbacks *callbacks, int visible, int logging)
{
    Instance *m = create(name, type == 1 ? CO_SIMULATION : MODEL_EXCHANGE);
    int status;
    (void)resources;
    (void)visible;
    if (!m) return NULL;
    if (callbacks) {
        m->logger = (void (*)(void))callbacks->logger;
        m->environment = callbacks->environment;
    }
    set_logging(m, logging, 0, NULL);
    status = check_instance(m, "fmuGUID", guid);
    if (status == FINE && type != 0 && type != 1)
        status = problem(m, FAILED, "fmuType is %d; pass fmi2ModelExchange (0) or fmi2CoSimulation (1)", type);
    if (finish(m, "fmi2Instantiate", status) == FINE) return m;
    destroy(m);
    return NULL;
}

EXPORT void FMI(FreeInstance)(void *);
EXPORT void FMI(FreeInstance)(void *c) { destroy(c); }

CALL(SetDebugLogging, (void *c, int on, size_t n, const char *const *names), status = set_logging(m, on, n, names))
CALL(SetupExperiment, (void *c, int has_tolerance, double tolerance, double begin, int has_stop, double stop),
     status = setup(m, has_tolerance, tolerance, begin, has_stop, stop))
CALL(EnterInitializationMode, (void *c), {
    if (m->now.has_clock) m->now.state = S_InitializationMode;
    else status = problem(m, FAILED, "fmi2SetupExperiment was not called; call it before fmi2EnterInitializationMode");
})
CALL(ExitInitializationMode, (void *c), {
    if (m->now.kind == CO_SIMULATION) handle_event(m);
    m->now.state = m->now.kind == CO_SIMULATION ? S_StepComplete : S_EventMode;
})
CALL(Terminate, (void *c), m->now.state = S_Terminated)
CALL(Reset, (void *c), {
    start(m);
    m->now.state = S_Instantiated;
})

CALL(GetReal, (REFERENCES, double *values), status = get_values(m, vr, n, values))
CALL(SetReal, (REFERENCES, const double *values), status = set_values(m, vr, n, values, phase_of(m->now.state)))
#define NONE(name, type)              \
    CALL(name, (REFERENCES, type values), { \
        (void)vr;                     \
        (void)values;                 \
        status = no_variables(m, n);  \
    })
NONE(GetInteger, int *)
NONE(GetBoolean, int *)
NONE(GetString, const char **)
NONE(SetInteger, const int *)
NONE(SetBoolean, const int *)
NONE(SetString, const char *const *)

CALL(GetFMUstate, (void *c, void **state), status = get_state(m, state))
CALL(SetFMUstate, (void *c, void *state), status = set_state(m, state))
CALL(FreeFMUstate, (void *c, void **state), status = free_state(state))
CALL(SerializedFMUstateSize, (void *c, void *state, size_t *size), status = state_size(m, state, size))
CALL(SerializeFMUstate, (void *c, void *state, char *bytes, size_t n), status = serialize(m, state, bytes, n))
CALL(DeSerializeFMUstate, (void *c, const char *bytes, size_t n, void **state),
     status = deserialize(m, bytes, n, state))
CALL(GetDirectionalDerivative,
     (void *c, const Reference *unknowns, size_t n_unknowns, const Reference *knowns, size_t n_knowns, const double *seeds,
      double *result),
     status = partial(m, unknowns, n_unknowns, knowns, n_knowns, seeds, result, 0, phase_of(m->now.state)))

CALL(SetRealInputDerivatives, (REFERENCES, const Order *orders, const double *values), {
    size_t i;
    if (n > 0 && (!vr || !orders || !values)) status = null(m, "valueReferences, order or values");
    for (i = 0; i < n && status == FINE; i++) {
        int index = index_of(m, vr[i]);
        if (index < 0) status = FAILED;
        else if (orders[i] != 1)
            status = problem(m, FAILED, "the derivative of order %d of %s was asked for; only order 1 is available",
                             orders[i], variables[index].label);
        else if (variables[index].role != INPUT)
            status = problem(m, FAILED, "%s is no input and has no derivative to set", variables[index].label);
        else if (!isfinite(values[i]))
            status = problem(m, FAILED, "time derivative of %s = %g is not a finite number; check what computes it",
                             variables[index].label, values[i]);
        else m->now.slopes[index] = values[i];
    }
})
CALL(GetRealOutputDerivatives, (REFERENCES, const Order *orders, double *values),
     status = output_derivatives(m, vr, n, orders, values))
CALL(DoStep, (void *c, double time, double step, int is_final), {
    (void)is_final;
    status = do_step(m, time, step);
    if (status == DISCARD) m->now.state = S_StepFailed;
})
CALL(CancelStep, (void *c), status = FINE)

static int no_status(Instance *m, int kind)
{
    return problem(m, DISCARD, "there is no status of kind %d", kind);
}

CALL(GetStatus, (void *c, int kind, int *value), {
    if (!value) status = null(m, "value");
    else if (kind != 0) status = no_status(m, kind);
    else *value = m->now.state == S_StepFailed ? DISCARD : FINE;
})
CALL(GetRealStatus, (void *c, int kind, double *value), {
    if (!value) status = null(m, "value");
    else if (kind != 2) status = no_status(m, kind);
    else *value = m->now.clock;
})
CALL(GetIntegerStatus, (void *c, int kind, int *value), {
    (void)value;
    status = no_status(m, kind);
})
CALL(GetBooleanStatus, (void *c, int kind, int *value), {
    if (!value) status = null(m, "value");
    else if (kind != 3) status = no_status(m, kind);
    else *value = 0;
})
CALL(GetStringStatus, (void *c, int kind, const char **value), {
    (void)value;
    status = no_status(m, kind);
})

CALL(EnterEventMode, (void *c), m->now.state = S_EventMode)
CALL(EnterContinuousTimeMode, (void *c), m->now.state = S_ContinuousTimeMode)
CALL(NewDiscreteStates, (void *c, EventInfo *info), {
    if (!info) status = null(m, "fmi2EventInfo");
    else {
        handle_event(m);
        memset(info, 0, sizeof *info);
        info->next_event_time_defined = next_time_event(m, &info->next_event_time);
    }
})
CALL(CompletedIntegratorStep, (void *c, int is_final, int *enter_event_mode, int *terminate), {
    (void)is_final;
    if (!enter_event_mode || !terminate) status = null(m, "enterEventMode or terminateSimulation");
    else *enter_event_mode = *terminate = 0;
})
CALL(SetTime, (void *c, double time), status = set_time(m, time))
CALL(SetContinuousStates, (void *c, const double *x, size_t n), status = set_states(m, x, n))
CALL(GetDerivatives, (void *c, double *x, size_t n), status = get_derivatives(m, x, n))
CALL(GetEventIndicators, (void *c, double *z, size_t n), {
    (void)z;
    status = no_indicators(m, n);
})
CALL(GetContinuousStates, (void *c, double *x, size_t n), status = get_states(m, x, n))
CALL(GetNominalsOfContinuousStates, (void *c, double *x, size_t n), status = get_nominals(m, x, n))
