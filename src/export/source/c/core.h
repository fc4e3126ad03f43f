/* A running model: values, steps, derivatives, FMU states. The same methods as pilotage's binary FMUs: Dormand-Prince
 * 5(4) with step size control, exact steps of linear models, delays from the history of their signals. Everything is in
 * one compilation unit, so that FMUs can be linked together; memory is taken by instantiation and FMU states alone. */

#include <float.h>
#include <math.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Severity of a problem: fmi2Status and fmi3Status. */
enum { FINE, WARNING, DISCARD, FAILED, FATAL };
enum { CO_SIMULATION = 1, MODEL_EXCHANGE = 2 };
enum { INPUT, OUTPUT, FIXED, TUNABLE, STATE, LOCAL, DERIVATIVE, CLOCK };
/* Where the value of a variable is. */
enum { IN_VALUES, IN_STATES, IN_OUTPUTS, IN_RATES, IN_TIME };
enum { AT_START, AT_EVENT, CONTINUOUS };

typedef struct {
    const char *label;
    int role, place, position;
    double start, min, max;
} Variable;

#include "model.h"

/* C has no arrays without elements. */
#define SIZE(n) ((n) > 0 ? (n) : 1)
#define N_SIGNALS (N_INPUTS + N_DELAYS)

#define DEFAULT_TOLERANCE 1e-9
#define MAX_STEPS 1000000L
#define APART (64.0 * DBL_EPSILON)

#ifndef PILOTAGE_PIECES
/* Steps of the integrator that delays look back on at most. */
#define PILOTAGE_PIECES 4096
#endif

#if N_DELAYS
/* Delayed signals in a step of the integrator: value and two derivatives at both ends; whether something jumps at its
 * begin. */
typedef struct {
    double from, to, ends[N_DELAYS][2][3];
    int is_break;
} Piece;
#endif

/* Everything that changes while a simulation runs. */
typedef struct {
    int kind, state, has_started, has_clock, has_stop;
    double time, tolerance, handled;
    double values[SIZE(N_VALUES)];
    double slopes[SIZE(N_INPUTS)], last_slopes[SIZE(N_INPUTS)];
    double states[SIZE(N_STATES)];
    double clock, stop, anchor, step, count;
#if N_DELAYS
    int first, n_pieces, is_cut;
    Piece pieces[PILOTAGE_PIECES];
#endif
} Snapshot;

#if IS_LINEAR
typedef struct {
    double states[SIZE(N_STATES)][SIZE(N_STATES)], forced[SIZE(N_STATES)][SIZE(N_INPUTS)],
        slopes[SIZE(N_STATES)][SIZE(N_INPUTS)], diagonal, above;
} Rows;

typedef struct {
    int is_known;
    double step, p[SIZE(N_PARAMETERS)];
    Rows rows;
} Transition;
#else
typedef struct {
    double t, x[SIZE(N_STATES)], f[SIZE(N_STATES)], x_end[SIZE(N_STATES)], f_end[SIZE(N_STATES)];
    double k[5][SIZE(N_STATES)], absolute[SIZE(N_STATES)];
    double h, last, done_h, done_error;
    int is_known, has_h, has_last, is_done, done_last, is_undefined;
} Solver;
#endif

typedef struct Instance {
    Snapshot now;
    int n_delays;
    double inputs[SIZE(N_SIGNALS)], outputs[SIZE(N_COMPUTED)], rates[SIZE(N_STATES)];
#if N_TIMES
    double times[2][N_TIMES];
#endif
#if IS_LINEAR
    Transition transitions[2];
    Rows work[7];
#else
    Solver solver;
    /* A part of a step without a change of a condition on time: first and last time of an evaluation, and the next change. */
    double low, high, next_stop, begin;
    double taus[SIZE(N_DELAYS)];
#endif
    /* Tangents of values, states, inputs with delayed signals, parameters; results. */
    double d_values[SIZE(N_VALUES)], d_states[SIZE(N_STATES)], d_inputs[SIZE(N_SIGNALS)], d_rates[SIZE(N_STATES)],
        d_outputs[SIZE(N_COMPUTED)];
    char *name;
    int enabled[4], event_mode, early_return;
    void *environment;
    void (*logger)(void);
    void (*update)(void);
    char message[600];
} Instance;

static int problem(Instance *m, int severity, const char *format, ...)
{
    va_list list;
    va_start(list, format);
    vsnprintf(m->message, sizeof m->message, format, list);
    va_end(list);
    return severity;
}

static double *parameters(Instance *m) { return m->now.values + FIRST_PARAMETER; }

#if N_CURVES
static double curve(const double *x, const double *y, int n, int is_steps, double at)
{
    int low = 0, high = n;
    double part;
    if (isnan(at)) return NAN;
    while (low < high) {
        int middle = (low + high) / 2;
        if (x[middle] <= at) low = middle + 1;
        else high = middle;
    }
    if (low == 0) return is_steps ? 0.0 : y[0];
    if (low == n && at > x[n - 1]) return is_steps ? 0.0 : y[n - 1];
    low = low - 1 < n - 2 ? low - 1 : n - 2;
    if (is_steps) return y[low];
    part = (at / 2.0 - x[low] / 2.0) / (x[low + 1] / 2.0 - x[low] / 2.0);
    return (1.0 - part) * y[low] + part * y[low + 1];
}

#if HAS_SLOPES
static double curve_slope(const double *x, const double *y, int n, int is_steps, double at)
{
    int k = 0;
    if (is_steps || isnan(at) || at < x[0] || at > x[n - 1]) return 0.0;
    while (k < n - 2 && x[k + 1] <= at) k++;
    return (y[k + 1] - y[k]) / (x[k + 1] - x[k]);
}
#endif
#endif

#include "equations.h"

/* Time ------------------------------------------------------------------------------------------------------------- */

static double apart(double time, double near) { return APART * fmax(fabs(time), fabs(near)); }

/* All times at which a condition on time changes, with inputs that follow their slopes; infinite where there is none. */
static const double *switch_times(Instance *m, double elapsed)
{
#if N_TIMES
    double *times = m->times[0], *moved = m->times[1], u[SIZE(N_INPUTS)];
    const double *held = m->now.values, *p = parameters(m);
    double begin = m->now.time + elapsed;
    int i, k, is_held = 1;
    for (i = 0; i < N_INPUTS; i++) {
        is_held = is_held && m->now.slopes[i] == 0.0;
        u[i] = held[i] + m->now.slopes[i] * (begin - m->now.time);
    }
    model_switches(is_held ? held : u, p, times);
    for (k = 0; k < N_TIMES; k++) {
        if (!is_held) {
            double first = times[k] - begin, second;
            for (i = 0; i < N_INPUTS; i++) u[i] = held[i] + m->now.slopes[i] * (times[k] - m->now.time);
            model_switches(u, p, moved);
            second = moved[k] - times[k];
            /* A step of the secant method. */
            if (second != 0.0 && first != second) times[k] = begin + first * first / (first - second);
        }
        if (!isfinite(times[k])) times[k] = HUGE_VAL;
    }
    return times;
#else
    (void)m;
    (void)elapsed;
    return NULL;
#endif
}

/* The next change of a condition on time; 0 if there is none. */
static int next_time_event(Instance *m, double *time)
{
    const double *times = switch_times(m, 0.0);
    double now = m->now.time;
    int k, found = 0;
    for (k = 0; k < N_TIMES; k++)
        if (isfinite(times[k]) && times[k] > now + apart(times[k], now) && (!found || times[k] < *time)) {
            *time = times[k];
            found = 1;
        }
    if (!found) *time = 0.0;
    return found;
}

/* The current time, or one just beside it where a condition changes: before, until events were handled. */
static double sided_time(Instance *m)
{
    const double *times = switch_times(m, 0.0);
    double now = m->now.time;
    int k;
    for (k = 0; k < N_TIMES; k++)
        if (isfinite(times[k]) && fabs(now - times[k]) <= apart(times[k], now)) {
            double a = apart(times[k], now);
            return m->now.handled >= times[k] - a ? times[k] + a : times[k] - a;
        }
    return now;
}

/* Delays ----------------------------------------------------------------------------------------------------------- */

#if N_DELAYS
static void jet_of(const Piece *piece, int signal, double time, double *jet)
{
    double h = piece->to - piece->from, c = (time - piece->from) / h, a[6], b[3], missing[3];
    const double *from = piece->ends[signal][0], *to = piece->ends[signal][1];
    int i;
    a[0] = from[0], a[1] = from[1] * h, a[2] = 0.5 * from[2] * h * h;
    b[0] = to[0], b[1] = to[1] * h, b[2] = 0.5 * to[2] * h * h;
    missing[0] = b[0] - a[0] - a[1] - a[2];
    missing[1] = b[1] - a[1] - 2.0 * a[2];
    missing[2] = b[2] - a[2];
    a[3] = 10.0 * missing[0] - 4.0 * missing[1] + missing[2];
    a[4] = -15.0 * missing[0] + 7.0 * missing[1] - 2.0 * missing[2];
    a[5] = 6.0 * missing[0] - 3.0 * missing[1] + missing[2];
    jet[0] = jet[1] = jet[2] = 0.0;
    for (i = 5; i >= 0; i--) {
        jet[2] = jet[2] * c + 2.0 * jet[1];
        jet[1] = jet[1] * c + jet[0];
        jet[0] = jet[0] * c + a[i];
    }
    jet[1] /= h;
    jet[2] /= h * h;
}

/* A signal `tau` before now with two derivatives, on the side after that time or before it. */
static void delayed(const Snapshot *s, int signal, double now, double tau, int is_after, double *jet)
{
    double time = now - tau, same = APART * fabs(now);
    const Piece *pieces = s->pieces + s->first;
    int low = 0, high = s->n_pieces;
    while (low < high) {
        int middle = (low + high) / 2;
        if (is_after ? pieces[middle].from <= time + same : pieces[middle].from < time - same) low = middle + 1;
        else high = middle;
    }
    if (low > 0) {
        const Piece *piece = pieces + low - 1;
        double at = time < piece->to ? time : piece->to;
        jet_of(piece, signal, is_after && at < piece->from ? piece->from : at, jet);
    } else if (is_after) {
        delayed(s, signal, now, tau, 0, jet);
    } else {
        jet[0] = s->n_pieces > 0 && s->is_cut ? pieces[0].ends[signal][0][0] : 0.0;
        jet[1] = jet[2] = 0.0;
    }
}

/* Drops what is before the longest delay. */
static void cut_history(Snapshot *s, double now, const double *tau)
{
    double longest = 0.0, time;
    int k;
    for (k = 0; k < N_DELAYS; k++) longest = fmax(longest, tau[k]);
    time = now - longest - APART * fabs(now);
    while (s->n_pieces > 1 && s->pieces[s->first].to < time) {
        s->first++;
        s->n_pieces--;
        s->is_cut = 1;
    }
}

static int push_history(Instance *m, double from, double to, double (*starts)[3], double (*ends)[3])
{
    Snapshot *s = &m->now;
    const Piece *last = s->n_pieces > 0 ? s->pieces + s->first + s->n_pieces - 1 : NULL;
    Piece *piece;
    double h = to - from, powers[3];
    int k, i, is_break = 0;
    if (to <= from) return FINE;
    if (s->n_pieces == PILOTAGE_PIECES) cut_history(s, from, m->taus);
    if (s->n_pieces == PILOTAGE_PIECES)
        return problem(m, DISCARD,
                       "at %g s the delays look back on more than %d steps of the integrator; compile with a larger "
                       "PILOTAGE_PIECES",
                       from, PILOTAGE_PIECES);
    if (last && last->to - last->from > h) h = last->to - last->from;
    powers[0] = 1.0, powers[1] = h, powers[2] = 0.5 * h * h;
    for (k = 0; k < N_DELAYS; k++) {
        double size = fmax(fabs(starts[k][0]), fabs(ends[k][0]));
        if (last) size = fmax(size, fabs(last->ends[k][1][0]));
        for (i = 0; i < 3; i++) {
            double before = last ? last->ends[k][1][i] : 0.0;
            if (powers[i] * fabs(starts[k][i] - before) > 1e-9 * size) is_break = 1;
        }
    }
    if (s->first + s->n_pieces == PILOTAGE_PIECES) {
        memmove(s->pieces, s->pieces + s->first, (size_t)s->n_pieces * sizeof(Piece));
        s->first = 0;
    }
    piece = s->pieces + s->first + s->n_pieces++;
    piece->from = from;
    piece->to = to;
    piece->is_break = is_break;
    for (k = 0; k < N_DELAYS; k++) {
        memcpy(piece->ends[k][0], starts[k], sizeof starts[k]);
        memcpy(piece->ends[k][1], ends[k], sizeof ends[k]);
    }
    return FINE;
}
#endif

/* The inputs, and after them the delayed signals with their rates where delays are exact. */
static const double *signals(Instance *m, double *rates)
{
    memcpy(m->inputs, m->now.values, N_INPUTS * sizeof(double));
#if N_DELAYS
    if (m->n_delays) {
        double tau[N_DELAYS], jet[3];
        int k;
        delay_times(parameters(m), tau);
        for (k = 0; k < N_DELAYS; k++) {
            delayed(&m->now, k, m->now.time, tau[k], 1, jet);
            m->inputs[N_INPUTS + k] = jet[0];
            if (rates) rates[N_INPUTS + k] = jet[1];
        }
    }
#else
    (void)rates;
#endif
    return m->inputs;
}

/* Equations -------------------------------------------------------------------------------------------------------- */

static void rates_at(Instance *m, double time, const double *x, const double *u, double *rates)
{
#if N_DELAYS
    if (m->n_delays) {
        exact_rates(time, x, u, parameters(m), rates);
        return;
    }
#endif
    model_rates(time, x, u, parameters(m), rates);
}

static void outputs_at(Instance *m, double time, const double *x, const double *u, double *outputs)
{
#if N_DELAYS
    if (m->n_delays) {
        exact_outputs(time, x, u, parameters(m), outputs);
        return;
    }
#endif
    model_outputs(time, x, u, parameters(m), outputs);
}

static void derivatives(Instance *m, double *rates)
{
    rates_at(m, sided_time(m), m->now.states, signals(m, NULL), rates);
}

static double value_of(Instance *m, int index, int *has_outputs)
{
    const Variable *v = variables + index;
    switch (v->place) {
    case IN_VALUES: return m->now.values[v->position];
    case IN_STATES: return m->now.states[v->position];
    case IN_OUTPUTS:
        if (!*has_outputs) outputs_at(m, m->now.time, m->now.states, signals(m, NULL), m->outputs);
        *has_outputs = 1;
        return m->outputs[v->position];
    case IN_RATES:
        derivatives(m, m->rates);
        return m->rates[v->position];
    default: return m->now.time;
    }
}

static void start(Instance *m)
{
    Snapshot *s = &m->now;
    int i;
    s->time = 0.0;
    s->tolerance = DEFAULT_TOLERANCE;
    s->handled = -DBL_MAX;
    s->has_started = s->has_clock = 0;
    for (i = 0; i < N_VALUES; i++) s->values[i] = variables[i].start;
    for (i = 0; i < N_STATES; i++) s->states[i] = s->values[FIRST_START + i];
    for (i = 0; i < N_INPUTS; i++) s->slopes[i] = s->last_slopes[i] = 0.0;
#if N_DELAYS
    s->first = s->n_pieces = s->is_cut = 0;
#endif
}

/* Sets a parameter before the start, and the start values that follow from it. */
static void set_parameter(Instance *m, int index, double value)
{
#if HAS_STARTS
    double before[SIZE(N_STATES)], after[SIZE(N_STATES)];
    int i;
    memcpy(before, m->now.values + FIRST_START, N_STATES * sizeof(double));
    memcpy(after, before, sizeof after);
    model_starts(parameters(m), before);
    m->now.values[index] = value;
    model_starts(parameters(m), after);
    for (i = 0; i < N_STATES; i++)
        if (before[i] != after[i] && m->now.values[FIRST_START + i] == before[i])
            m->now.values[FIRST_START + i] = m->now.states[i] = after[i];
#else
    m->now.values[index] = value;
#endif
}

/* Derivatives ------------------------------------------------------------------------------------------------------ */

static void forward(Instance *m, int is_exact, double time, double d_time, const double *values, const double *states,
                    const double *inputs, double *rates, double *outputs)
{
    const double *p = values + FIRST_PARAMETER, *dp = m->d_values + FIRST_PARAMETER;
#if N_DELAYS
    if (is_exact) {
        exact_forward(time, d_time, states, m->d_states, inputs, m->d_inputs, p, dp, rates, m->d_rates, outputs,
                      m->d_outputs);
        return;
    }
#else
    (void)is_exact;
#endif
    model_forward(time, d_time, states, m->d_states, inputs, m->d_inputs, p, dp, rates, m->d_rates, outputs,
                  m->d_outputs);
}

static int is_nan_in(const double *list, int n)
{
    int i;
    for (i = 0; i < n; i++)
        if (isnan(list[i])) return 1;
    return 0;
}

static void widen(const double *values, const double *by, int n, double *size, double *change)
{
    int i;
    for (i = 0; i < n; i++)
        if (by[i] != 0.0) {
            *size = fmax(*size, fabs(values[i]));
            *change = fmax(*change, fabs(by[i]));
        }
}

static void shift(const double *values, const double *by, double h, int n, double *out)
{
    int i;
    for (i = 0; i < n; i++) out[i] = values[i] + h * by[i];
}

/* Rates and outputs in the direction of the tangents that are set, into d_rates and d_outputs. Where a formula has no
 * derivative, as the square root at 0, it is a central difference. */
static void tangents(Instance *m, int is_exact, double d_time)
{
    double rates[2][SIZE(N_STATES)], outputs[2][SIZE(N_COMPUTED)], size = 1.0, change = 0.0, h;
    int i, side;
    forward(m, is_exact, m->now.time, d_time, m->now.values, m->now.states, m->inputs, m->rates, m->outputs);
    if (!is_nan_in(m->d_rates, N_STATES) && !is_nan_in(m->d_outputs, N_COMPUTED)) return;
    widen(m->now.values, m->d_values, N_VALUES, &size, &change);
    widen(m->now.states, m->d_states, N_STATES, &size, &change);
    widen(m->inputs, m->d_inputs, N_SIGNALS, &size, &change);
    widen(&m->now.time, &d_time, 1, &size, &change);
    h = cbrt(DBL_EPSILON) * size / change;
    for (side = 0; side < 2; side++) {
        double values[SIZE(N_VALUES)], states[SIZE(N_STATES)], u[SIZE(N_SIGNALS)], own = side ? -h : h;
        double time = m->now.time + own * d_time;
        shift(m->now.values, m->d_values, own, N_VALUES, values);
        shift(m->now.states, m->d_states, own, N_STATES, states);
        shift(m->inputs, m->d_inputs, own, N_SIGNALS, u);
#if N_DELAYS
        if (is_exact) {
            exact_rates(time, states, u, values + FIRST_PARAMETER, rates[side]);
            exact_outputs(time, states, u, values + FIRST_PARAMETER, outputs[side]);
            continue;
        }
#endif
        model_rates(time, states, u, values + FIRST_PARAMETER, rates[side]);
        model_outputs(time, states, u, values + FIRST_PARAMETER, outputs[side]);
    }
    for (i = 0; i < N_STATES; i++)
        if (isnan(m->d_rates[i])) m->d_rates[i] = (rates[0][i] - rates[1][i]) / (2.0 * h);
    for (i = 0; i < N_COMPUTED; i++)
        if (isnan(m->d_outputs[i])) m->d_outputs[i] = (outputs[0][i] - outputs[1][i]) / (2.0 * h);
}

static void clear_tangents(Instance *m)
{
    memset(m->d_values, 0, sizeof m->d_values);
    memset(m->d_states, 0, sizeof m->d_states);
    memset(m->d_inputs, 0, sizeof m->d_inputs);
}

static double tangent_of(const Instance *m, int index)
{
    const Variable *v = variables + index;
    switch (v->place) {
    case IN_STATES: return m->d_states[v->position];
    case IN_OUTPUTS: return m->d_outputs[v->position];
    case IN_RATES: return m->d_rates[v->position];
    default: return 0.0;
    }
}

/* The tangents in the direction of a known. */
static void seed(Instance *m, int index, double part)
{
    const Variable *v = variables + index;
    if (v->place == IN_STATES) {
        m->d_states[v->position] += part;
        return;
    }
    m->d_values[index] += part;
    if (index < N_INPUTS) m->d_inputs[index] += part;
    if (index >= FIRST_START && index < FIRST_START + N_STATES) m->d_states[index - FIRST_START] += part;
}

/* Time derivative of an output at the end of the last step. */
static double output_derivative(Instance *m, int index)
{
    clear_tangents(m);
    memcpy(m->d_values, m->now.last_slopes, N_INPUTS * sizeof(double));
    memcpy(m->d_inputs, m->now.last_slopes, N_INPUTS * sizeof(double));
    signals(m, m->d_inputs);
    rates_at(m, sided_time(m), m->now.states, m->inputs, m->d_states);
    tangents(m, m->n_delays > 0, 1.0);
    return tangent_of(m, index);
}

/* Steps ------------------------------------------------------------------------------------------------------------ */

#if IS_LINEAR
/* Exact steps of linear models: the exponential of the matrix of states, inputs and their slopes (Van Loan 1978), by a
 * Pade approximant of degree 13 with scaling and squaring (Higham 2005) of the balanced matrix (Parlett & Reinsch
 * 1969). */

static void scaled(Rows *out, const Rows *a, double factor)
{
    int i, j;
    for (i = 0; i < N_STATES; i++) {
        for (j = 0; j < N_STATES; j++) out->states[i][j] = a->states[i][j] * factor;
        for (j = 0; j < N_INPUTS; j++) {
            out->forced[i][j] = a->forced[i][j] * factor;
            out->slopes[i][j] = a->slopes[i][j] * factor;
        }
    }
    out->diagonal = a->diagonal * factor;
    out->above = a->above * factor;
}

static void add(Rows *out, const Rows *a, double factor)
{
    int i, j;
    for (i = 0; i < N_STATES; i++) {
        for (j = 0; j < N_STATES; j++) out->states[i][j] += a->states[i][j] * factor;
        for (j = 0; j < N_INPUTS; j++) {
            out->forced[i][j] += a->forced[i][j] * factor;
            out->slopes[i][j] += a->slopes[i][j] * factor;
        }
    }
    out->diagonal += a->diagonal * factor;
    out->above += a->above * factor;
}

static void add_identity(Rows *out, double factor)
{
    int i;
    for (i = 0; i < N_STATES; i++) out->states[i][i] += factor;
    out->diagonal += factor;
}

static void product(Rows *out, const Rows *a, const Rows *b)
{
    int i, j, k;
    memset(out, 0, sizeof *out);
    for (i = 0; i < N_STATES; i++) {
        for (j = 0; j < N_INPUTS; j++) {
            out->forced[i][j] = a->forced[i][j] * b->diagonal;
            out->slopes[i][j] = a->forced[i][j] * b->above + a->slopes[i][j] * b->diagonal;
        }
        for (k = 0; k < N_STATES; k++) {
            double factor = a->states[i][k];
            for (j = 0; j < N_STATES; j++) out->states[i][j] += factor * b->states[k][j];
            for (j = 0; j < N_INPUTS; j++) {
                out->forced[i][j] += factor * b->forced[k][j];
                out->slopes[i][j] += factor * b->slopes[k][j];
            }
        }
    }
    out->diagonal = a->diagonal * b->diagonal;
    out->above = a->diagonal * b->above + a->above * b->diagonal;
}

static void swap_rows(double *a, double *b, int n)
{
    int j;
    for (j = 0; j < n; j++) {
        double own = a[j];
        a[j] = b[j];
        b[j] = own;
    }
}

/* Solves a X = right by elimination with row pivots; X is written to right. */
static void solve(Rows *a, Rows *right)
{
    double diagonal = right->diagonal / a->diagonal, above = (right->above - a->above * diagonal) / a->diagonal;
    int i, j, k;
    for (i = 0; i < N_STATES; i++)
        for (j = 0; j < N_INPUTS; j++) {
            right->slopes[i][j] += -a->forced[i][j] * above - a->slopes[i][j] * diagonal;
            right->forced[i][j] -= a->forced[i][j] * diagonal;
        }
    for (k = 0; k < N_STATES; k++) {
        int pivot = k;
        for (i = k + 1; i < N_STATES; i++)
            if (fabs(a->states[i][k]) > fabs(a->states[pivot][k])) pivot = i;
        if (pivot != k) {
            swap_rows(a->states[k], a->states[pivot], N_STATES);
            swap_rows(right->states[k], right->states[pivot], N_STATES);
            swap_rows(right->forced[k], right->forced[pivot], N_INPUTS);
            swap_rows(right->slopes[k], right->slopes[pivot], N_INPUTS);
        }
        for (i = 0; i < N_STATES; i++) {
            double factor;
            if (i == k) continue;
            factor = a->states[i][k] / a->states[k][k];
            if (factor == 0.0) continue;
            for (j = k; j < N_STATES; j++) a->states[i][j] -= factor * a->states[k][j];
            for (j = 0; j < N_STATES; j++) right->states[i][j] -= factor * right->states[k][j];
            for (j = 0; j < N_INPUTS; j++) {
                right->forced[i][j] -= factor * right->forced[k][j];
                right->slopes[i][j] -= factor * right->slopes[k][j];
            }
        }
    }
    for (i = 0; i < N_STATES; i++) {
        for (j = 0; j < N_STATES; j++) right->states[i][j] /= a->states[i][i];
        for (j = 0; j < N_INPUTS; j++) {
            right->forced[i][j] /= a->states[i][i];
            right->slopes[i][j] /= a->states[i][i];
        }
    }
    right->diagonal = diagonal;
    right->above = above;
}

/* The 1-norm; NaN if an entry is NaN. */
static double norm(const double *a, int columns, int stride)
{
    double largest = 0.0;
    int i, j;
    for (j = 0; j < columns; j++) {
        double sum = 0.0;
        for (i = 0; i < N_STATES; i++) sum += fabs(a[i * stride + j]);
        if (sum > largest || isnan(sum)) largest = sum;
    }
    return largest;
}

static void balance(double (*a)[SIZE(N_STATES)], double *scales)
{
    int i, j, is_done = 0;
    for (i = 0; i < N_STATES; i++) scales[i] = 1.0;
    while (!is_done) {
        is_done = 1;
        for (i = 0; i < N_STATES; i++) {
            double column = 0.0, row = 0.0, factor = 1.0, before;
            for (j = 0; j < N_STATES; j++) {
                column += a[j][i] * a[j][i];
                row += a[i][j] * a[i][j];
            }
            before = column + row;
            column = sqrt(column);
            row = sqrt(row);
            if (column == 0.0 || row == 0.0) continue;
            for (; column < row / 2.0; factor *= 2.0) column *= 2.0, row /= 2.0;
            for (; column >= row * 2.0; factor /= 2.0) column /= 2.0, row *= 2.0;
            if (column * column + row * row < 0.95 * before) {
                is_done = 0;
                scales[i] *= factor;
                for (j = 0; j < N_STATES; j++) a[j][i] *= factor;
                for (j = 0; j < N_STATES; j++) a[i][j] /= factor;
            }
        }
    }
}

static void exponential(Instance *m, Rows *a)
{
    static const double b[14] = {64764752532480000.0, 32382376266240000.0, 7771770303897600.0, 1187353796428800.0,
                                 129060195264000.0, 10559470521600.0, 670442572800.0, 33522128640.0, 1323241920.0,
                                 40840800.0, 960960.0, 16380.0, 182.0, 1.0};
    Rows *a2 = m->work, *a4 = m->work + 1, *a6 = m->work + 2, *even = m->work + 3, *odd = m->work + 4,
         *own = m->work + 5, *sum = m->work + 6;
    double wanted = ceil(log2(norm(a->states[0], N_STATES, SIZE(N_STATES)) / 5.371920351148152));
    int squarings = wanted > 0.0 ? (int)wanted : 0, k;
    scaled(own, a, pow(0.5, squarings));
    *a = *own;
    product(a2, a, a);
    product(a4, a2, a2);
    product(a6, a4, a2);
    for (k = 0; k < 2; k++) {
        Rows *part = k ? odd : even;
        scaled(sum, a2, b[8 + k]);
        add(sum, a4, b[10 + k]);
        add(sum, a6, b[12 + k]);
        product(part, a6, sum);
        add(part, a2, b[2 + k]);
        add(part, a4, b[4 + k]);
        add(part, a6, b[6 + k]);
        add_identity(part, b[k]);
    }
    product(own, a, odd);
    *a2 = *even;
    add(a2, own, -1.0);
    *a = *even;
    add(a, own, 1.0);
    solve(a2, a);
    for (k = 0; k < squarings; k++) {
        product(own, a, a);
        *a = *own;
    }
}

static int too_large(Instance *m, double h, double norm)
{
    return problem(m, DISCARD,
                   "the norm of the system matrix times the step of %g s is %g, more than 1e8; take a smaller step or "
                   "smaller coefficients",
                   h, norm);
}

static int make_transition(Instance *m, Transition *out, double h)
{
    double x[SIZE(N_STATES)] = {0}, u[SIZE(N_INPUTS)] = {0}, column[SIZE(N_STATES)], scales[SIZE(N_STATES)], size;
    Rows *a = &out->rows;
    int i, j;
    memset(a, 0, sizeof *a);
    out->is_known = 0;
    for (j = 0; j < N_STATES + N_INPUTS; j++) {
        double *unit = j < N_STATES ? x + j : u + j - N_STATES;
        *unit = 1.0;
        model_rates(m->now.time, x, u, parameters(m), column);
        *unit = 0.0;
        for (i = 0; i < N_STATES; i++) {
            if (j < N_STATES) a->states[i][j] = column[i] * h;
            else a->forced[i][j - N_STATES] = column[i] * h;
        }
    }
    a->above = h;
    size = norm(a->states[0], N_STATES, SIZE(N_STATES));
    if (!(size <= 1e150)) return too_large(m, h, size);
    size = norm(a->forced[0], N_INPUTS, SIZE(N_INPUTS));
    if (!(size <= 1e150)) return too_large(m, h, size);
    balance(a->states, scales);
    size = norm(a->states[0], N_STATES, SIZE(N_STATES));
    if (!(size <= 1e8)) return too_large(m, h, size);
    for (i = 0; i < N_STATES; i++)
        for (j = 0; j < N_INPUTS; j++) a->forced[i][j] /= scales[i];
    exponential(m, a);
    for (i = 0; i < N_STATES; i++) {
        double sum = 0.0;
        for (j = 0; j < N_STATES; j++) sum += fabs(a->states[i][j] *= scales[i] / scales[j]);
        for (j = 0; j < N_INPUTS; j++) {
            a->forced[i][j] *= scales[i];
            a->slopes[i][j] *= scales[i];
            sum += fabs(a->forced[i][j]) + fabs(a->slopes[i][j]);
        }
        if (!isfinite(sum))
            return problem(m, DISCARD, "the linear system overflows within a step of %g s; take a smaller step", h);
    }
    out->step = h;
    memcpy(out->p, parameters(m), N_PARAMETERS * sizeof(double));
    out->is_known = 1;
    return FINE;
}

static int is_for(const Transition *t, double h, const double *p)
{
    return t->is_known && t->step == h && memcmp(t->p, p, N_PARAMETERS * sizeof(double)) == 0;
}

static int not_finite(Instance *m, int state, double value, double step)
{
    return problem(m, DISCARD, "state %s is %g after %g s; the model or what drives it is unstable",
                   state_names[state], value, step);
}

static int step_states(Instance *m, double h, double *elapsed)
{
    const double *p = parameters(m), *u = m->now.values;
    const Rows *rows;
    int i, j, k, status;
    /* A master that checks its steps alternates between whole and half steps. */
    k = is_for(m->transitions, h, p) ? 0 : is_for(m->transitions + 1, h, p) ? 1 : -1;
    if (k < 0) {
        m->transitions[1] = m->transitions[0];
        k = 0;
        status = make_transition(m, m->transitions, h);
        if (status != FINE) return status;
    }
    rows = &m->transitions[k].rows;
    for (i = 0; i < N_STATES; i++) {
        double sum = 0.0;
        for (j = 0; j < N_INPUTS; j++) sum += rows->forced[i][j] * u[j];
        for (j = 0; j < N_INPUTS; j++) sum += rows->slopes[i][j] * m->now.slopes[j];
        for (j = 0; j < N_STATES; j++) sum += rows->states[i][j] * m->now.states[j];
        if (!isfinite(sum)) return not_finite(m, i, sum, h);
        m->rates[i] = sum;
    }
    memcpy(m->now.states, m->rates, N_STATES * sizeof(double));
    *elapsed = h;
    return FINE;
}
#else
/* Inputs at a time of the step, counted from its begin, and the time at which conditions are evaluated. */
static double inputs_at(Instance *m, double time)
{
    double now = m->now.time + time;
    int i;
    for (i = 0; i < N_INPUTS; i++) m->inputs[i] = m->now.values[i] + m->now.slopes[i] * time;
#if N_DELAYS
    for (i = 0; i < m->n_delays; i++) {
        double jet[3];
        delayed(&m->now, i, now, m->taus[i], now <= m->begin, jet);
        m->inputs[N_INPUTS + i] = jet[0];
    }
#endif
    return fmin(fmax(now, m->low), m->high);
}

/* The derivatives at a time of the step; 0 if they are not finite. */
static int flow(Instance *m, double time, const double *x, double *f)
{
    double sum = 0.0, now = inputs_at(m, time);
    int i;
    rates_at(m, now, x, m->inputs, f);
    for (i = 0; i < N_STATES; i++) sum += fabs(f[i]);
    if (sum < HUGE_VAL) return 1;
    m->solver.is_undefined = 1;
    return 0;
}

#define STAGE(c, slope, sum)                                                     \
    for (i = 0; i < N_STATES; i++) s->x_end[i] = s->x[i] + h * (sum);             \
    if (!flow(m, s->t + (c) * h, s->x_end, slope)) return HUGE_VAL

/* A step of the method of Dormand & Prince (1980); its error relative to the permitted one. */
static double attempt(Instance *m, double h)
{
    Solver *s = &m->solver;
    double *k0 = s->f, *k1 = s->k[0], *k2 = s->k[1], *k3 = s->k[2], *k4 = s->k[3], *k5 = s->k[4], *k6 = s->f_end;
    double sum = 0.0, size = 0.0;
    int i;
    STAGE(1.0 / 5.0, k1, 1.0 / 5.0 * k0[i]);
    STAGE(3.0 / 10.0, k2, 3.0 / 40.0 * k0[i] + 9.0 / 40.0 * k1[i]);
    STAGE(4.0 / 5.0, k3, 44.0 / 45.0 * k0[i] + -56.0 / 15.0 * k1[i] + 32.0 / 9.0 * k2[i]);
    STAGE(8.0 / 9.0, k4,
          19372.0 / 6561.0 * k0[i] + -25360.0 / 2187.0 * k1[i] + 64448.0 / 6561.0 * k2[i] + -212.0 / 729.0 * k3[i]);
    STAGE(1.0, k5,
          9017.0 / 3168.0 * k0[i] + -355.0 / 33.0 * k1[i] + 46732.0 / 5247.0 * k2[i] + 49.0 / 176.0 * k3[i] +
              -5103.0 / 18656.0 * k4[i]);
    STAGE(1.0, k6,
          35.0 / 384.0 * k0[i] + 500.0 / 1113.0 * k2[i] + 125.0 / 192.0 * k3[i] + -2187.0 / 6784.0 * k4[i] +
              11.0 / 84.0 * k5[i]);
    for (i = 0; i < N_STATES; i++) {
        double error = h * (71.0 / 57600.0 * k0[i] + -71.0 / 16695.0 * k2[i] + 71.0 / 1920.0 * k3[i] +
                            -17253.0 / 339200.0 * k4[i] + 22.0 / 525.0 * k5[i] + -1.0 / 40.0 * k6[i]);
        double part = error / (s->absolute[i] + m->now.tolerance * fmax(fabs(s->x[i]), fabs(s->x_end[i])));
        sum += part * part;
        size += fabs(s->x_end[i]);
    }
    if (!isfinite(size) || !isfinite(sum)) return HUGE_VAL;
    return N_STATES > 0 ? sqrt(sum / SIZE(N_STATES)) : 0.0;
}

static double clamp(double value, double low, double high) { return value < low ? low : value > high ? high : value; }

#ifndef PILOTAGE_FIXED_STEP
static double factor(const Solver *s, double error)
{
    if (!isfinite(error)) return 0.25;
    return 0.9 * pow(fmax(error, 1e-10), -0.17) * pow(s->has_last ? s->last : 1e-4, 0.04);
}
#endif

/* Derives the length of the next step from the last one. */
static void settle(Solver *s)
{
#ifndef PILOTAGE_FIXED_STEP
    double next;
    if (!s->is_done) return;
    next = s->done_h * clamp(factor(s, s->done_error), 0.2, 8.0);
    /* A step shortened to a limit says little about the next one. */
    s->h = s->done_last && s->has_h && s->h > next ? s->h : next;
    s->has_h = 1;
    s->last = fmax(s->done_error, 1e-4);
    s->has_last = 1;
#endif
    s->is_done = 0;
}

static void restart(Solver *s, double t, const double *x)
{
    settle(s);
    s->t = t;
    memmove(s->x, x, N_STATES * sizeof(double));
    s->is_known = s->has_last = 0;
}

/* Length of the next step up to a limit, and whether it ends there. */
static double length(const Solver *s, double limit, int *is_last)
{
    double rest = limit - s->t;
#ifdef PILOTAGE_FIXED_STEP
    double wanted = PILOTAGE_FIXED_STEP;
    *is_last = wanted * (1.0 + 1e-9) >= rest;
    return *is_last ? rest : wanted;
#else
    double wanted = s->has_h ? s->h : rest;
    *is_last = N_STATES == 0 || wanted * 1.01 >= rest;
    if (*is_last) return rest;
    /* Avoids a short remaining step. */
    return wanted * 2.0 > rest ? rest * 0.5 : wanted;
#endif
}

static int undefined(Instance *m, int is_beyond)
{
    double time = m->now.time + m->solver.t;
    if (!is_beyond)
        return problem(m, DISCARD, "the states or their derivatives are not defined or not finite at %g s", time);
    return problem(m, DISCARD,
                   "the derivatives are not defined or not finite shortly after %g s, however short the step", time);
}

static int advance(Instance *m, double limit)
{
    Solver *s = &m->solver;
    settle(s);
    if (!s->is_known) {
        double sum = 0.0;
        int i;
        for (i = 0; i < N_STATES; i++) sum += fabs(s->x[i]);
        if (!isfinite(sum) || !flow(m, s->t, s->x, s->f)) return undefined(m, 0);
        s->is_known = 1;
    }
    for (;;) {
        int is_last;
        double h = length(s, limit, &is_last), error;
        if ((h < 16.0 * DBL_EPSILON * fabs(s->t) && !is_last) || h < DBL_MIN) {
            if (s->is_undefined) return undefined(m, 1);
            return problem(m, DISCARD,
                           "at %g s a step of %g s still has too large an error: is there a jump that is no event, or "
                           "a pole?",
                           m->now.time + s->t, h);
        }
        s->is_undefined = 0;
        error = attempt(m, h);
#ifdef PILOTAGE_FIXED_STEP
        if (!isfinite(error)) return undefined(m, 1);
#else
        if (error > 1.0) {
            s->h = h * clamp(factor(s, error), 0.1, 0.9);
            s->has_h = 1;
            continue;
        }
#endif
        s->is_done = 1;
        s->done_h = h;
        s->done_error = error;
        s->done_last = is_last;
        s->t = is_last ? limit : s->t + h;
        memcpy(s->x, s->x_end, sizeof s->x);
        memcpy(s->f, s->f_end, sizeof s->f);
        return FINE;
    }
}

#if N_DELAYS
/* The delayed signals with two derivatives along the solution, after a jump at that time or before it. */
static void jets(Instance *m, double time, const double *x, int is_after, double (*out)[3])
{
    double now = m->now.time + time, at, rates[SIZE(N_STATES)], second[SIZE(N_STATES)];
    double u1[SIZE(N_SIGNALS)], u2[SIZE(N_SIGNALS)];
    int i;
    m->begin = is_after ? now : fmin(m->begin, now);
    at = inputs_at(m, time);
    exact_rates(at, x, m->inputs, parameters(m), rates);
    for (i = 0; i < N_INPUTS; i++) u1[i] = m->now.slopes[i], u2[i] = 0.0;
    for (i = 0; i < N_DELAYS; i++) {
        double jet[3];
        delayed(&m->now, i, now, m->taus[i], now <= m->begin, jet);
        u1[N_INPUTS + i] = jet[1];
        u2[N_INPUTS + i] = jet[2];
    }
    clear_tangents(m);
    exact_forward(at, 1.0, x, rates, m->inputs, u1, parameters(m), m->d_values + FIRST_PARAMETER, m->rates, second,
                  m->outputs, m->d_outputs);
    exact_signals(at, x, rates, second, m->inputs, u1, u2, parameters(m), out);
}

/* Where the next step of the integrator ends at the latest: what it takes of the past must be known, and jumps end
 * steps. */
static double limited(const Instance *m, double time, double h)
{
    const Snapshot *s = &m->now;
    double now = s->time + time, next = h, shortest = HUGE_VAL;
    int k, i;
    for (k = 0; k < N_DELAYS; k++) {
        shortest = fmin(shortest, m->taus[k]);
        for (i = 0; i < s->n_pieces; i++) {
            const Piece *piece = s->pieces + s->first + i;
            if (piece->is_break && piece->from + m->taus[k] > now + APART * fabs(now)) {
                next = fmin(next, piece->from + m->taus[k] - s->time);
                break;
            }
        }
    }
    return next - time > shortest ? fmin(time + shortest, next) : next;
}
#endif

static int advance_any(Instance *m, double end)
{
#if N_DELAYS
    if (m->n_delays) {
        Solver *s = &m->solver;
        double starts[N_DELAYS][3], ends[N_DELAYS][3], from = s->t, limit = limited(m, from, end);
        int status;
        m->begin = m->now.time + from;
        jets(m, from, s->x, 1, starts);
        status = advance(m, limit);
        if (status != FINE) return status;
        jets(m, s->t, s->x, 0, ends);
        status = push_history(m, m->now.time + from, m->now.time + s->t, starts, ends);
        if (status != FINE) return status;
        /* The derivative is another one after a jump. */
        if (s->t >= limit && limit < end) restart(s, s->t, s->x);
        return FINE;
    }
#endif
    return advance(m, end);
}

/* The part of a step of length `h` that begins at `elapsed`, up to the first change of a condition on time. */
static void set_window(Instance *m, double elapsed, double h)
{
    const double *times = switch_times(m, elapsed);
    double from = m->now.time + elapsed, end = m->now.time + h;
    int k;
    m->low = -HUGE_VAL;
    m->high = m->next_stop = HUGE_VAL;
    for (k = 0; k < N_TIMES; k++) {
        double time = times[k], a = apart(time, end);
        if (!isfinite(time)) continue;
        if (fabs(time - from) <= a) m->low = fmax(m->low, time + a);
        else if (time > from && time < end - a) m->next_stop = fmin(m->next_stop, time);
        else if (fabs(time - end) <= a) m->high = fmin(m->high, time - a);
    }
    if (isfinite(m->next_stop)) m->high = m->next_stop - apart(m->next_stop, end);
}

static int check_delays(Instance *m, double elapsed)
{
#if N_DELAYS
    int k;
    if (!m->n_delays) return FINE;
    delay_times(parameters(m), m->taus);
    for (k = 0; k < N_DELAYS; k++)
        if (!(m->taus[k] > 0.0))
            return problem(m, DISCARD, "at %g s: the time of a delay is %g s; it must be above 0; the integration ends "
                                       "there", m->now.time + elapsed, m->taus[k]);
#else
    (void)m;
    (void)elapsed;
#endif
    return FINE;
}

static int step_states(Instance *m, double h, double *elapsed)
{
    Solver *s = &m->solver;
    int status = FINE, i;
    for (i = 0; i < N_STATES; i++) s->absolute[i] = fmax(m->now.tolerance * nominals[i], DBL_MIN);
    while (*elapsed < h && status == FINE) {
        long count = 0;
        double end = h;
        set_window(m, *elapsed, h);
        if (isfinite(m->next_stop)) end = clamp(m->next_stop - m->now.time, *elapsed, h);
        status = check_delays(m, *elapsed);
        if (status != FINE) break;
        /* A step depends on its arguments and the state alone, so that equal calls give equal bits. */
        s->is_done = 0;
        restart(s, *elapsed, m->now.states);
        s->h = end - *elapsed;
        s->has_h = 1;
        s->is_undefined = 0;
        if (end <= *elapsed) continue;
        do {
            if (++count > MAX_STEPS) {
                status = problem(m, DISCARD,
                                 "%ld steps of the integrator were not enough for %g s, only for %g s; take a shorter "
                                 "step or slower coefficients",
                                 MAX_STEPS, h, s->t);
                break;
            }
            status = advance_any(m, end);
        } while (status == FINE && s->t < end);
        memcpy(m->now.states, s->x, N_STATES * sizeof(double));
        *elapsed = s->t;
    }
    return status;
}
#endif

/* Advances by `h` seconds; `elapsed` is the time that was reached. */
static int step_by(Instance *m, double h, double *elapsed)
{
    Snapshot *s = &m->now;
    int status = FINE, i;
    *elapsed = 0.0;
    if (N_STATES == 0) *elapsed = h;
    else status = step_states(m, h, elapsed);
#if IS_LINEAR
    /* Nothing has changed. */
    if (status != FINE) return status;
#endif
    s->has_started = 1;
    for (i = 0; i < N_INPUTS; i++) {
        s->values[i] += s->slopes[i] * *elapsed;
        s->last_slopes[i] = s->slopes[i];
        s->slopes[i] = 0.0;
    }
    s->time += *elapsed;
    s->handled = s->time;
#if N_DELAYS
    if (m->n_delays) {
        double tau[N_DELAYS];
        delay_times(parameters(m), tau);
        cut_history(s, s->time, tau);
    }
#endif
    return status;
}

/* One step of co-simulation from a communication point: equal steps are counted, so that the importer's rounding leaves
 * no trace. */
static int do_step(Instance *m, double time, double step)
{
    Snapshot *s = &m->now;
    double scale = fmax(fmax(fabs(time), fabs(s->clock)), step), end = time + step, elapsed, counted;
    int status, is_counted;
    if (!s->has_clock) return problem(m, FAILED, "no experiment was set up; do so before initialization mode");
    if (!(step > 0.0) || !isfinite(step))
        return problem(m, FAILED, "communicationStepSize = %g s; pass a finite number greater than 0", step);
    if (!(fabs(time - s->clock) <= 1e-9 * scale))
        return problem(m, FAILED, "currentCommunicationPoint = %g s, but the last step ended at %g s", time, s->clock);
    if (s->has_stop && end - s->stop > 1e-9 * fmax(fabs(s->stop), step))
        return problem(m, FAILED, "a step of %g s from %g s goes beyond stopTime = %g s", step, time, s->stop);
    counted = s->anchor + (s->count + 1.0) * s->step;
    is_counted = s->count > 0.0 && fabs(end - counted) <= 8.0 * DBL_EPSILON * fmax(fabs(end), scale);
    if (is_counted) step = s->step;
    s->time = s->clock;
    status = step_by(m, step, &elapsed);
    if (status == FINE) {
        s->clock = end;
        s->anchor = is_counted ? s->anchor : time;
        s->step = step;
        s->count = is_counted ? s->count + 1.0 : 1.0;
    } else if (elapsed > 0.0) {
        s->clock = s->anchor = s->clock + elapsed;
        s->step = s->count = 0.0;
    }
    s->time = s->clock;
    return status;
}

/* Calls ------------------------------------------------------------------------------------------------------------ */

static const char *const categories[4] = {"logStatusWarning", "logStatusDiscard", "logStatusError", "logStatusFatal"};

static void send(Instance *m, int status, const char *category, const char *message);

/* Ends a call: a problem is reported, and may change the state. */
static int finish(Instance *m, const char *function, int status)
{
    char text[800];
    if (status == FINE) return FINE;
    if (status >= FAILED) m->now.state = S_Error;
    if (m->enabled[status - 1] || status >= FAILED) {
        snprintf(text, sizeof text, "%s: %s", function, m->message);
        send(m, status, categories[status - 1], text);
    }
    return status;
}

static const char *state_name(int state)
{
    int bit = 0;
    while (bit < N_STATE_NAMES - 1 && !((state >> bit) & 1)) bit++;
    return calling_states[bit];
}

/* Checks that a function may be called now; `part` is the kind of instances that have it, 0 for all. */
static int enter(Instance *m, int legal, int part)
{
    char list[400] = "";
    int bit;
    size_t end = 0;
    if (!(legal & m->now.state)) {
        for (bit = 0; bit < N_STATE_NAMES; bit++)
            if (((legal >> bit) & 1) && end < sizeof list)
                end += (size_t)snprintf(list + end, sizeof list - end, "%s%s", end ? ", " : "", calling_states[bit]);
        return problem(m, FAILED, "not allowed in state \"%s\"; it is allowed in %s", state_name(m->now.state), list);
    }
    if (part && part != m->now.kind)
        return problem(m, FAILED, "it is for %s, but this instance was made for %s",
                       part == CO_SIMULATION ? "co-simulation" : part == MODEL_EXCHANGE ? "model exchange"
                                                                                        : "scheduled execution",
                       m->now.kind == CO_SIMULATION ? "co-simulation" : "model exchange");
    return FINE;
}

static int null(Instance *m, const char *argument)
{
    return problem(m, FAILED, "%s is NULL; pass a valid pointer", argument);
}

/* Index of a variable; -1 and a problem if there is none. */
static int index_of(Instance *m, Reference reference)
{
    if (reference >= 1 && reference <= N_VARIABLES) return (int)(reference - 1);
    problem(m, FAILED,
            "value reference %u belongs to no variable of this FMU; use those of modelDescription.xml, 1 to %d",
            (unsigned)reference, N_VARIABLES);
    return -1;
}

static Instance *create(const char *name, int kind)
{
    Instance *m = calloc(1, sizeof *m);
    size_t length = name ? strlen(name) + 1 : 1;
    if (!m) return NULL;
    m->name = calloc(length, 1);
    if (!m->name) {
        free(m);
        return NULL;
    }
    if (name) memcpy(m->name, name, length);
    m->now.kind = kind;
    m->now.state = S_Instantiated;
    m->n_delays = kind == CO_SIMULATION ? N_DELAYS : 0;
    start(m);
    return m;
}

/* Refuses an instance without a name or with another GUID. */
static int check_instance(Instance *m, const char *argument, const char *guid)
{
    if (!m->name[0]) return problem(m, FAILED, "instanceName is empty; pass a name");
    if (!guid) return null(m, argument);
    if (strcmp(guid, MODEL_GUID) != 0)
        return problem(m, FAILED,
                       "%s is %.60s, but the model has %s; modelDescription.xml and sources do not belong together, "
                       "export the FMU again",
                       argument, guid, MODEL_GUID);
    return FINE;
}

static void destroy(Instance *m)
{
    if (!m) return;
    free(m->name);
    free(m);
}

static int set_logging(Instance *m, int on, size_t count, const char *const *names)
{
    size_t i;
    int k, status = FINE;
    if (!names && count > 0) return null(m, "categories");
    for (k = 0; k < 4 && count == 0; k++) m->enabled[k] = on;
    for (i = 0; i < count; i++) {
        if (!names[i]) return null(m, "categories");
        for (k = 0; k < 4 && strcmp(names[i], categories[k]) != 0; k++) {}
        if (k < 4) m->enabled[k] = on;
        else status = problem(m, WARNING, "there is no log category %.60s", names[i]);
    }
    return status;
}

static int setup(Instance *m, int has_tolerance, double tolerance, double begin, int has_stop, double stop)
{
    Snapshot *s = &m->now;
    if (!isfinite(begin)) return problem(m, FAILED, "startTime = %g is not possible; pass a finite number", begin);
    if (has_stop && !(isfinite(stop) && stop >= begin))
        return problem(m, FAILED, "stopTime = %g is not possible; pass a number not before startTime", stop);
    if (has_tolerance && !(isfinite(tolerance) && tolerance > 0.0))
        return problem(m, FAILED, "tolerance = %g is not possible; pass a number greater than 0", tolerance);
    if (has_tolerance) s->tolerance = fmin(fmax(tolerance, 1e-12), 1e-4);
    s->has_clock = 1;
    s->has_stop = has_stop != 0;
    s->stop = has_stop ? stop : 0.0;
    s->clock = s->anchor = s->time = begin;
    s->step = s->count = 0.0;
    return FINE;
}

static int get_values(Instance *m, const Reference *references, size_t count, double *values)
{
    size_t i;
    int has_outputs = 0, bad = -1;
    double value = 0.0;
    if (count > 0 && !references) return null(m, "valueReferences");
    if (count > 0 && !values) return null(m, "values");
    for (i = 0; i < count; i++) {
        int index = index_of(m, references[i]);
        if (index < 0) return FAILED;
        values[i] = value_of(m, index, &has_outputs);
        if (IS_TEXT && bad < 0 && !isfinite(values[i])) bad = index, value = values[i];
    }
    if (bad < 0) return FINE;
    return problem(m, DISCARD, "%s is %g at %g s; the solver should take a smaller step", variables[bad].label, value,
                   m->now.has_clock ? m->now.clock : 0.0);
}

static int set_value(Instance *m, int index, double value)
{
    const Variable *v = variables + index;
    if (v->role != INPUT && v->role != FIXED && v->role != TUNABLE)
        return problem(m, FAILED, "%s is calculated and cannot be set", v->label);
    if (!isfinite(value))
        return problem(m, DISCARD, "%s = %g is not a finite number; check what computes it", v->label, value);
    if (v->role != INPUT && !(value >= v->min && value <= v->max))
        return problem(m, DISCARD, "%s = %g is out of its range %g to %g; set a value within it", v->label, value,
                       v->min, v->max);
    if (index >= FIRST_PARAMETER && index < FIRST_PARAMETER + N_PARAMETERS && !m->now.has_started)
        set_parameter(m, index, value);
    m->now.values[index] = value;
    if (index >= FIRST_START && index < FIRST_START + N_STATES) m->now.states[index - FIRST_START] = value;
    return FINE;
}

static int set_values(Instance *m, const Reference *references, size_t count, const double *values, int phase)
{
    size_t i;
    if (count > 0 && !references) return null(m, "valueReferences");
    if (count > 0 && !values) return null(m, "values");
    for (i = 0; i < count; i++) {
        int index = index_of(m, references[i]), status;
        const Variable *v = variables + index;
        if (index < 0) return FAILED;
        if ((v->role == FIXED && phase != AT_START) || (v->role == TUNABLE && phase == CONTINUOUS))
            return problem(m, FAILED, "%s is %s and cannot be set in state \"%s\"; set it %s", v->label,
                           v->role == FIXED ? "fixed" : "tunable", state_name(m->now.state),
                           v->role == FIXED ? "before initialization mode ends" : "in event mode");
        status = set_value(m, index, values[i]);
        /* A solver may try again with another step. */
        if (status == DISCARD && !(m->now.kind == MODEL_EXCHANGE && phase != AT_START)) status = FAILED;
        if (status != FINE) return status;
    }
    return FINE;
}

/* Variables of a type that no variable has: a call for zero variables is allowed. */
static int no_variables(Instance *m, size_t count)
{
    if (count == 0) return FINE;
    return problem(m, FAILED, "this FMU has no variables of this type; all are real");
}

static int output_derivatives(Instance *m, const Reference *references, size_t count, const Order *orders,
                              double *values)
{
    size_t i;
    if (count > 0 && (!references || !orders || !values)) return null(m, "valueReferences, orders or values");
    for (i = 0; i < count; i++) {
        int index = index_of(m, references[i]);
        if (index < 0) return FAILED;
        if (orders[i] != 1)
            return problem(m, FAILED, "the derivative of order %d of %s was asked for; only order 1 is available",
                           (int)orders[i], variables[index].label);
        if (variables[index].role != OUTPUT)
            return problem(m, FAILED, "%s is no output; pass outputs alone", variables[index].label);
        values[i] = output_derivative(m, index);
    }
    return FINE;
}

static int is_unknown(const Variable *v, int phase)
{
    return v->role == OUTPUT || v->role == DERIVATIVE || (v->role == STATE && phase == AT_START);
}

static int is_known(const Variable *v, int phase)
{
    if (v->role == INPUT) return 1;
    if (v->role == FIXED || v->role == TUNABLE) return phase == AT_START;
    return v->place == IN_STATES && phase != AT_START;
}

/* Partial derivatives: for each unknown in the direction of the seed, or (adjoint) for each known against the seed. */
static int partial(Instance *m, const Reference *unknowns, size_t n_unknowns, const Reference *knowns, size_t n_knowns,
                   const double *seeds, double *result, int is_adjoint, int phase)
{
    size_t i, k;
    int is_exact = m->n_delays > 0, index;
    if ((n_unknowns > 0 && !unknowns) || (n_knowns > 0 && !knowns)) return null(m, "unknowns or knowns");
    if (((is_adjoint ? n_unknowns : n_knowns) > 0 && !seeds) || ((is_adjoint ? n_knowns : n_unknowns) > 0 && !result))
        return null(m, "seed or sensitivity");
    for (i = 0; i < n_unknowns; i++) {
        if ((index = index_of(m, unknowns[i])) < 0) return FAILED;
        if (!is_unknown(variables + index, phase))
            return problem(m, FAILED, "%s is not an unknown in state \"%s\"; pass outputs and derivatives of states",
                           variables[index].label, state_name(m->now.state));
        /* Who asks for those of states linearises, and needs the states that approximate delays. */
        if (!is_adjoint && (variables[index].place == IN_STATES || variables[index].role == DERIVATIVE)) is_exact = 0;
    }
    for (k = 0; k < n_knowns; k++) {
        if ((index = index_of(m, knowns[k])) < 0) return FAILED;
        if (!is_known(variables + index, phase))
            return problem(m, FAILED,
                           "%s is not a known in state \"%s\"; pass inputs and, in initialization mode, parameters, "
                           "later states",
                           variables[index].label, state_name(m->now.state));
        if (!is_adjoint && variables[index].place == IN_STATES) is_exact = 0;
    }
    signals(m, NULL);
    clear_tangents(m);
    for (k = 0; k < n_knowns; k++) {
        seed(m, index_of(m, knowns[k]), is_adjoint ? 1.0 : seeds[k]);
        if (!is_adjoint) continue;
        tangents(m, is_exact, 0.0);
        result[k] = 0.0;
        for (i = 0; i < n_unknowns; i++) result[k] += seeds[i] * tangent_of(m, index_of(m, unknowns[i]));
        clear_tangents(m);
    }
    if (is_adjoint) return FINE;
    tangents(m, is_exact, 0.0);
    for (i = 0; i < n_unknowns; i++) result[i] = tangent_of(m, index_of(m, unknowns[i]));
    return FINE;
}

/* Handles an event: conditions on time that change now have changed. */
static void handle_event(Instance *m) { m->now.handled = m->now.time; }

static int check_number(Instance *m, const char *argument, size_t found, size_t expected)
{
    if (found == expected) return FINE;
    return problem(m, FAILED, "%s = %lu, but there are %lu", argument, (unsigned long)found, (unsigned long)expected);
}

static int set_time(Instance *m, double time)
{
    if (!m->now.has_clock) return problem(m, FAILED, "no experiment was set up; do so before initialization mode");
    if (!(isfinite(time) && time >= m->now.anchor))
        return problem(m, FAILED, "time = %g s; pass a finite number not before the start time %g s", time,
                       m->now.anchor);
    m->now.clock = m->now.time = time;
    return FINE;
}

/* Rejects states or derivatives that are not finite. */
static int check_finite(Instance *m, const double *values, int first)
{
    int i;
    for (i = 0; i < N_STATES; i++)
        if (!isfinite(values[i]))
            return problem(m, DISCARD, "%s of %s is %g at %g s; the solver should take a smaller step",
                           first ? "the derivative" : "the value", state_names[i], values[i], m->now.clock);
    return FINE;
}

static int set_states(Instance *m, const double *x, size_t n)
{
    int status = n > 0 && !x ? null(m, "x") : check_number(m, "nx", n, N_STATES);
    if (status == FINE) status = check_finite(m, x, 0);
    if (status != FINE) return status;
    m->now.has_started = 1;
    if (n > 0) memcpy(m->now.states, x, n * sizeof(double));
    return FINE;
}

static int get_states(Instance *m, double *x, size_t n)
{
    int status = n > 0 && !x ? null(m, "values") : check_number(m, "nx", n, N_STATES);
    if (status == FINE && n > 0) memcpy(x, m->now.states, n * sizeof(double));
    return status;
}

static int get_nominals(Instance *m, double *x, size_t n)
{
    int status = n > 0 && !x ? null(m, "values") : check_number(m, "nx", n, N_STATES);
    if (status == FINE && n > 0) memcpy(x, nominals, n * sizeof(double));
    return status;
}

static int get_derivatives(Instance *m, double *x, size_t n)
{
    int status = n > 0 && !x ? null(m, "values") : check_number(m, "nx", n, N_STATES);
    if (status != FINE || n == 0) return status;
    derivatives(m, x);
    return check_finite(m, x, 1);
}

static int no_indicators(Instance *m, size_t n) { return check_number(m, "ni", n, 0); }

/* FMU states ------------------------------------------------------------------------------------------------------- */

typedef struct {
    char magic[8], guid[40];
    uint64_t size;
} Header;

static size_t used_size(const Snapshot *s)
{
#if N_DELAYS
    return offsetof(Snapshot, pieces) + (size_t)(s->first + s->n_pieces) * sizeof(Piece);
#else
    return sizeof *s;
#endif
}

static void fill_header(Header *header, size_t size)
{
    memset(header, 0, sizeof *header);
    memcpy(header->magic, "PILOTSRC", 8);
    strncpy(header->guid, MODEL_GUID, sizeof header->guid - 1);
    header->size = size;
}

static int get_state(Instance *m, void **state)
{
    if (!state) return null(m, "FMUstate");
    if (!*state) *state = malloc(sizeof(Snapshot));
    if (!*state) return problem(m, FAILED, "there is no memory for the FMU state");
    memcpy(*state, &m->now, used_size(&m->now));
    return FINE;
}

static int set_state(Instance *m, const void *state)
{
    const Snapshot *own = state;
    if (!own) return null(m, "FMUstate");
    if (own->kind != m->now.kind)
        return problem(m, FAILED, "the FMU state is of an instance for another kind of simulation");
    memcpy(&m->now, own, used_size(own));
    return FINE;
}

static int free_state(void **state)
{
    if (state) {
        free(*state);
        *state = NULL;
    }
    return FINE;
}

static int state_size(Instance *m, const void *state, size_t *size)
{
    if (!state || !size) return null(m, "FMUstate or size");
    *size = sizeof(Header) + used_size(state);
    return FINE;
}

static int serialize(Instance *m, const void *state, void *bytes, size_t size)
{
    Header header;
    size_t used;
    if (!state || !bytes) return null(m, "FMUstate or serializedState");
    used = used_size(state);
    if (size < sizeof header + used)
        return problem(m, FAILED, "size = %lu, but the FMU state needs %lu bytes; ask for their number first",
                       (unsigned long)size, (unsigned long)(sizeof header + used));
    fill_header(&header, used);
    memcpy(bytes, &header, sizeof header);
    memcpy((char *)bytes + sizeof header, state, used);
    return FINE;
}

static int deserialize(Instance *m, const void *bytes, size_t size, void **state)
{
    Header header, found;
    Snapshot *own;
    if (!bytes || !state) return null(m, "serializedState or FMUstate");
    memset(&found, 0, sizeof found);
    if (size >= sizeof found) memcpy(&found, bytes, sizeof found);
    fill_header(&header, size - sizeof header);
    if (size < sizeof header + offsetof(Snapshot, count) || memcmp(&header, &found, sizeof header) != 0 ||
        size - sizeof header > sizeof *own)
        return problem(m, FAILED, "serializedState is no state of this FMU; pass bytes that the same FMU serialized");
    own = calloc(1, sizeof *own);
    if (!own) return problem(m, FAILED, "there is no memory for the FMU state");
    memcpy(own, (const char *)bytes + sizeof header, size - sizeof header);
#if N_DELAYS
    if (own->first < 0 || own->n_pieces < 0 || own->first > PILOTAGE_PIECES - own->n_pieces) own->kind = 0;
#endif
    if (own->kind != m->now.kind || !(own->state & (ALL_STATES)) || used_size(own) != size - sizeof header) {
        free(own);
        return problem(m, FAILED, "serializedState is no state of this instance; pass bytes that the same FMU serialized");
    }
    *state = own;
    return FINE;
}

/* A function of the VERSION of FMI that includes this: its arguments, and what it does with the instance `m` unless that is refused. */
#define CALL(name, arguments, ...)                                 \
    EXPORT int FMI(name) arguments;                               \
    EXPORT int FMI(name) arguments                                \
    {                                                             \
        Instance *m = c;                                          \
        int status;                                               \
        if (!m) return FAILED;                                    \
        status = enter(m, MAY_##name, PART_##name);               \
        if (status == FINE) __VA_ARGS__;                          \
        return finish(m, VERSION #name, status);                  \
    }
#define REFERENCES void *c, const Reference *vr, size_t n
