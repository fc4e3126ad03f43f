/* The functions of FMI 3.0 (sections 2.2, 3.2, 4.2 and 5.2), declared here: no header of the standard is needed.
 * Where several FMUs are linked together, FMI3_FUNCTION_PREFIX is defined for each, usually as the name of the model and
 * an underscore (section 2.2.2); in a library of its own the names have no prefix. */

#include <stdbool.h>

#define PASTE_(a, b) a##b
#define PASTE(a, b) PASTE_(a, b)
#if defined(FMI3_FUNCTION_PREFIX) && !defined(FMI3_OVERRIDE_FUNCTION_PREFIX)
#define FMI(name) PASTE(FMI3_FUNCTION_PREFIX, fmi3##name)
#else
#define FMI(name) fmi3##name
#endif

#if defined(_WIN32) || defined(__CYGWIN__)
#define EXPORT __declspec(dllexport)
#elif defined(__GNUC__)
#define EXPORT __attribute__((visibility("default")))
#else
#define EXPORT
#endif

typedef void (*Logger)(void *, int, const char *, const char *);
typedef void (*Update)(void *, double, bool, bool, bool, bool, bool *, double *);

static void send(Instance *m, int status, const char *category, const char *message)
{
    if (m->logger) ((Logger)m->logger)(m->environment, status, category, message);
}

static int phase_of(int state)
{
    if (state == S_Instantiated || state == S_InitializationMode) return AT_START;
    return state == S_ContinuousTimeMode || state == S_IntermediateUpdateMode ? CONTINUOUS : AT_EVENT;
}

#define VERSION "fmi3"

EXPORT const char *FMI(GetVersion)(void);
EXPORT const char *FMI(GetVersion)(void) { return "3.0"; }

static void *instantiate(const char *function, const char *name, const char *token, int kind, bool logging,
                         void *environment, Logger logger)
{
    Instance *m = create(name, kind);
    int status;
    if (!m) return NULL;
    m->logger = (void (*)(void))logger;
    m->environment = environment;
    set_logging(m, logging, 0, NULL);
    status = check_instance(m, "instantiationToken", token);
    if (status == FINE && kind == 0)
        status = problem(m, FAILED, "this FMU is for co-simulation and model exchange; call "
                                    "fmi3InstantiateCoSimulation or fmi3InstantiateModelExchange");
    if (finish(m, function, status) == FINE) return m;
    destroy(m);
    return NULL;
}

#define BEGIN const char *name, const char *token, const char *resources, bool visible, bool logging

EXPORT void *FMI(InstantiateModelExchange)(BEGIN, void *environment, Logger logger);
EXPORT void *FMI(InstantiateModelExchange)(BEGIN, void *environment, Logger logger)
{
    (void)resources;
    (void)visible;
    return instantiate("fmi3InstantiateModelExchange", name, token, MODEL_EXCHANGE, logging, environment, logger);
}

EXPORT void *FMI(InstantiateCoSimulation)(BEGIN, bool event_mode, bool early_return, const Reference *required,
                                          size_t n_required, void *environment, Logger logger, Update update);
EXPORT void *FMI(InstantiateCoSimulation)(BEGIN, bool event_mode, bool early_return, const Reference *required,
                                          size_t n_required, void *environment, Logger logger, Update update)
{
    Instance *m = instantiate("fmi3InstantiateCoSimulation", name, token, CO_SIMULATION, logging, environment, logger);
    (void)resources;
    (void)visible;
    (void)required;
    if (!m) return NULL;
    m->event_mode = event_mode;
    m->early_return = early_return;
    if (n_required > 0) m->update = (void (*)(void))update;
    return m;
}

EXPORT void *FMI(InstantiateScheduledExecution)(BEGIN, void *environment, Logger logger, void (*clock_update)(void *),
                                                void (*lock)(void), void (*unlock)(void));
EXPORT void *FMI(InstantiateScheduledExecution)(BEGIN, void *environment, Logger logger, void (*clock_update)(void *),
                                                void (*lock)(void), void (*unlock)(void))
{
    (void)resources;
    (void)visible;
    (void)clock_update;
    (void)lock;
    (void)unlock;
    return instantiate("fmi3InstantiateScheduledExecution", name, token, 0, logging, environment, logger);
}

EXPORT void FMI(FreeInstance)(void *);
EXPORT void FMI(FreeInstance)(void *c) { destroy(c); }

CALL(SetDebugLogging, (void *c, bool on, size_t n, const char *const *names), status = set_logging(m, on, n, names))
CALL(EnterInitializationMode,
     (void *c, bool has_tolerance, double tolerance, double begin, bool has_stop, double stop), {
         status = setup(m, has_tolerance, tolerance, begin, has_stop, stop);
         if (status == FINE) m->now.state = S_InitializationMode;
     })
CALL(ExitInitializationMode, (void *c), {
    int is_step = m->now.kind == CO_SIMULATION && !m->event_mode;
    if (is_step) handle_event(m);
    m->now.state = is_step ? S_StepMode : S_EventMode;
})
CALL(Terminate, (void *c), m->now.state = S_Terminated)
CALL(Reset, (void *c), {
    start(m);
    m->now.state = S_Instantiated;
})

CALL(GetFloat64, (REFERENCES, double *values, size_t n_values), {
    status = check_number(m, "nValues", n_values, n);
    if (status == FINE) status = get_values(m, vr, n, values);
})
CALL(SetFloat64, (REFERENCES, const double *values, size_t n_values), {
    status = check_number(m, "nValues", n_values, n);
    if (status == FINE) status = set_values(m, vr, n, values, phase_of(m->now.state));
})
#define NO_VALUES(name, type)                                 \
    CALL(name, (REFERENCES, type values, size_t n_values), {  \
        (void)vr;                                             \
        (void)values;                                         \
        (void)n_values;                                       \
        status = no_variables(m, n);                          \
    })
#define NO_TYPE(name, type)        \
    NO_VALUES(Get##name, type *)   \
    NO_VALUES(Set##name, const type *)
NO_TYPE(Float32, float)
NO_TYPE(Int8, int8_t)
NO_TYPE(UInt8, uint8_t)
NO_TYPE(Int16, int16_t)
NO_TYPE(UInt16, uint16_t)
NO_TYPE(Int32, int32_t)
NO_TYPE(UInt32, uint32_t)
NO_TYPE(Int64, int64_t)
NO_TYPE(UInt64, uint64_t)
NO_TYPE(Boolean, bool)
NO_VALUES(GetString, const char **)
NO_VALUES(SetString, const char *const *)
#define NO_BINARIES(name, size, type)                                       \
    CALL(name, (REFERENCES, size sizes, type values, size_t n_values), {    \
        (void)vr;                                                           \
        (void)sizes;                                                        \
        (void)values;                                                       \
        (void)n_values;                                                     \
        status = no_variables(m, n);                                        \
    })
NO_BINARIES(GetBinary, size_t *, const uint8_t **)
NO_BINARIES(SetBinary, const size_t *, const uint8_t *const *)
#define NO_CLOCKS(name, type)              \
    CALL(name, (REFERENCES, type values), { \
        (void)vr;                          \
        (void)values;                      \
        status = no_variables(m, n);       \
    })
NO_CLOCKS(GetClock, bool *)
NO_CLOCKS(SetClock, const bool *)
NO_CLOCKS(GetShiftDecimal, double *)
NO_CLOCKS(SetIntervalDecimal, const double *)
NO_CLOCKS(SetShiftDecimal, const double *)
#define NO_FRACTIONS(name, a, b)             \
    CALL(name, (REFERENCES, a one, b other), { \
        (void)vr;                            \
        (void)one;                           \
        (void)other;                         \
        status = no_variables(m, n);         \
    })
NO_FRACTIONS(GetIntervalDecimal, double *, int *)
NO_FRACTIONS(GetShiftFraction, uint64_t *, uint64_t *)
NO_FRACTIONS(SetIntervalFraction, const uint64_t *, const uint64_t *)
NO_FRACTIONS(SetShiftFraction, const uint64_t *, const uint64_t *)
CALL(GetIntervalFraction, (REFERENCES, uint64_t *counters, uint64_t *resolutions, int *qualifiers), {
    (void)vr;
    (void)counters;
    (void)resolutions;
    (void)qualifiers;
    status = no_variables(m, n);
})

/* The dependencies of an unknown: their place in the list, or -1. */
static int dependencies_of(Instance *m, Reference reference)
{
    int index = index_of(m, reference);
    if (index >= 0 && dependency_ends[index][0] < 0)
        problem(m, FAILED, "%s is not an unknown in state \"%s\"; pass outputs and derivatives of states",
                variables[index].label, state_name(m->now.state));
    return index >= 0 ? (dependency_ends[index][0] < 0 ? -1 : index) : -1;
}

CALL(GetNumberOfVariableDependencies, (void *c, Reference reference, size_t *count), {
    int index = count ? dependencies_of(m, reference) : -1;
    if (!count) status = null(m, "nDependencies");
    else if (index < 0) status = FAILED;
    else *count = (size_t)(dependency_ends[index][1] - dependency_ends[index][0]);
})
CALL(GetVariableDependencies,
     (void *c, Reference dependent, size_t *own_elements, Reference *independents, size_t *elements, int *kinds, size_t n),
     {
         int index = dependencies_of(m, dependent);
         size_t i;
         if (n > 0 && (!own_elements || !independents || !elements || !kinds)) status = null(m, "independents");
         else if (index < 0) status = FAILED;
         else
             status = check_number(m, "nDependencies", n,
                                   (size_t)(dependency_ends[index][1] - dependency_ends[index][0]));
         for (i = 0; i < n && status == FINE; i++) {
             const int *own = dependencies[(size_t)dependency_ends[index][0] + i];
             own_elements[i] = elements[i] = 0;
             independents[i] = (Reference)own[0] + 1;
             kinds[i] = own[1] ? 1 : 5;
         }
     })

CALL(GetFMUState, (void *c, void **state), status = get_state(m, state))
CALL(SetFMUState, (void *c, void *state), status = set_state(m, state))
CALL(FreeFMUState, (void *c, void **state), status = free_state(state))
CALL(SerializedFMUStateSize, (void *c, void *state, size_t *size), status = state_size(m, state, size))
CALL(SerializeFMUState, (void *c, void *state, uint8_t *bytes, size_t n), status = serialize(m, state, bytes, n))
CALL(DeserializeFMUState, (void *c, const uint8_t *bytes, size_t n, void **state),
     status = deserialize(m, bytes, n, state))

#define PARTIAL(name, n_from, n_to, is_adjoint)                                                                        \
    CALL(name,                                                                                                         \
         (void *c, const Reference *unknowns, size_t n_unknowns, const Reference *knowns, size_t n_knowns,               \
          const double *seeds, size_t n_seeds, double *result, size_t n_result),                                       \
         {                                                                                                             \
             status = check_number(m, "nSeed", n_seeds, n_from);                                                       \
             if (status == FINE) status = check_number(m, "nSensitivity", n_result, n_to);                             \
             if (status == FINE)                                                                                       \
                 status = partial(m, unknowns, n_unknowns, knowns, n_knowns, seeds, result, is_adjoint,                \
                                  phase_of(m->now.state));                                                             \
         })
PARTIAL(GetDirectionalDerivative, n_knowns, n_unknowns, 0)
PARTIAL(GetAdjointDerivative, n_unknowns, n_knowns, 1)
CALL(GetOutputDerivatives, (REFERENCES, const Order *orders, double *values, size_t n_values), {
    status = check_number(m, "nValues", n_values, n);
    if (status == FINE) status = output_derivatives(m, vr, n, orders, values);
})

CALL(EnterConfigurationMode, (void *c),
     status = problem(m, FAILED, "this FMU has no structural parameters, so there is nothing to configure"))
CALL(ExitConfigurationMode, (void *c),
     status = problem(m, FAILED, "this FMU has no structural parameters, so there is nothing to configure"))
CALL(ActivateModelPartition, (void *c, Reference clock, double time), {
    (void)clock;
    (void)time;
    status = problem(m, FAILED, "this FMU has no model partitions");
})

static int to_mode(Instance *m, int state)
{
    if (m->now.kind == CO_SIMULATION && !m->event_mode)
        return problem(m, FAILED, "there is no event mode, since the instance was made with eventModeUsed = fmi3False");
    m->now.state = state;
    return FINE;
}

CALL(EnterEventMode, (void *c), status = to_mode(m, S_EventMode))
CALL(EnterStepMode, (void *c), status = to_mode(m, S_StepMode))
CALL(EnterContinuousTimeMode, (void *c), status = to_mode(m, S_ContinuousTimeMode))
CALL(EvaluateDiscreteStates, (void *c), status = FINE)
CALL(UpdateDiscreteStates,
     (void *c, bool *needs_update, bool *terminate, bool *nominals_changed, bool *values_changed, bool *has_next,
      double *next),
     {
         if (!needs_update || !terminate || !nominals_changed || !values_changed || !has_next || !next)
             status = null(m, "a result");
         else {
             handle_event(m);
             *needs_update = *terminate = *nominals_changed = *values_changed = false;
             *has_next = next_time_event(m, next) != 0;
         }
     })

/* Asks the importer for the inputs at the end of a step; they change linearly within it. */
static int ask_inputs(Instance *m, double time, double step)
{
    double before[SIZE(N_INPUTS)], return_time = 0.0;
    bool wants_return = false;
    int i;
    if (!m->update || !(step > 0.0)) return FINE;
    memcpy(before, m->now.values, N_INPUTS * sizeof(double));
    m->now.state = S_IntermediateUpdateMode;
    ((Update)m->update)(m->environment, time + step, true, false, false, false, &wants_return, &return_time);
    /* Unless a call from the callback has failed. */
    if (m->now.state != S_IntermediateUpdateMode)
        return problem(m, FAILED, "a call during the intermediate update has failed");
    m->now.state = S_StepMode;
    for (i = 0; i < N_INPUTS; i++) {
        m->now.slopes[i] = (m->now.values[i] - before[i]) / step;
        m->now.values[i] = before[i];
    }
    return FINE;
}

CALL(DoStep,
     (void *c, double time, double step, bool is_final, bool *event_needed, bool *terminate, bool *early_return,
      double *last),
     {
         (void)is_final;
         status = ask_inputs(m, time, step);
         if (status == FINE && (!event_needed || !terminate || !early_return || !last)) status = null(m, "a result");
         if (status == FINE) {
             *event_needed = *terminate = *early_return = false;
             status = do_step(m, time, step);
             *last = m->now.clock;
         }
     })

CALL(CompletedIntegratorStep, (void *c, bool is_final, bool *enter_event_mode, bool *terminate), {
    (void)is_final;
    if (!enter_event_mode || !terminate) status = null(m, "enterEventMode or terminateSimulation");
    else *enter_event_mode = *terminate = false;
})
CALL(SetTime, (void *c, double time), status = set_time(m, time))
CALL(SetContinuousStates, (void *c, const double *x, size_t n), status = set_states(m, x, n))
CALL(GetContinuousStateDerivatives, (void *c, double *x, size_t n), status = get_derivatives(m, x, n))
CALL(GetEventIndicators, (void *c, double *z, size_t n), {
    (void)z;
    status = no_indicators(m, n);
})
CALL(GetContinuousStates, (void *c, double *x, size_t n), status = get_states(m, x, n))
CALL(GetNominalsOfContinuousStates, (void *c, double *x, size_t n), status = get_nominals(m, x, n))
#define COUNT(name, number)                       \
    CALL(name, (void *c, size_t *count), {        \
        if (!count) status = null(m, "count");    \
        else *count = number;                     \
    })
COUNT(GetNumberOfEventIndicators, 0)
COUNT(GetNumberOfContinuousStates, N_STATES)
