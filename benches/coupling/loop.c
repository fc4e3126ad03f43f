/* The loop that a master replaces: the same calls over dlopen, nothing else. Arguments: both libraries,
   number of steps, step. Prints microseconds per communication step, and y at the end. */
#include <dlfcn.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

typedef struct {
    void *instance;
    int (*set)(void *, const unsigned[], size_t, const double[]);
    int (*get)(void *, const unsigned[], size_t, double[]);
    int (*step)(void *, double, double, int);
} Component;

static Component open_component(const char *path) {
    void *library = dlopen(path, RTLD_NOW);
    if (!library) { fprintf(stderr, "%s\n", dlerror()); exit(1); }
    void *(*instantiate)(const char *, int, const char *, const char *, const void *, int, int) =
        dlsym(library, "fmi2Instantiate");
    int (*setup)(void *, int, double, double, int, double) = dlsym(library, "fmi2SetupExperiment");
    int (*enter)(void *) = dlsym(library, "fmi2EnterInitializationMode");
    int (*leave)(void *) = dlsym(library, "fmi2ExitInitializationMode");
    Component s = { instantiate("i", 1, "", "", NULL, 0, 0), dlsym(library, "fmi2SetReal"),
                dlsym(library, "fmi2GetReal"), dlsym(library, "fmi2DoStep") };
    if (setup(s.instance, 0, 0.0, 0.0, 0, 0.0) | enter(s.instance) | leave(s.instance)) exit(1);
    return s;
}

int main(int argc, char **argv) {
    if (argc != 5) return 2;
    Component controller = open_component(argv[1]), integrator = open_component(argv[2]);
    long steps = atol(argv[3]);
    double h = atof(argv[4]), u, y;
    const unsigned input = 0, output = 1;
    int failed = controller.get(controller.instance, &output, 1, &u)
               | integrator.get(integrator.instance, &output, 1, &y);
    struct timespec begin, end;
    clock_gettime(CLOCK_MONOTONIC, &begin);
    for (long k = 0; k < steps; k++) {
        failed |= controller.set(controller.instance, &input, 1, &y)
                | integrator.set(integrator.instance, &input, 1, &u)
                | controller.step(controller.instance, k * h, h, 1)
                | integrator.step(integrator.instance, k * h, h, 1)
                | controller.get(controller.instance, &output, 1, &u)
                | integrator.get(integrator.instance, &output, 1, &y);
    }
    clock_gettime(CLOCK_MONOTONIC, &end);
    double seconds = (end.tv_sec - begin.tv_sec) + 1e-9 * (end.tv_nsec - begin.tv_nsec);
    printf("%.6f %.17g\n", 1e6 * seconds / steps, y);
    return failed;
}
