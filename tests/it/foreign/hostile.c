/* An FMU of FMI 2.0 for co-simulation, x' = u - x, that does harm. Its GUID says what and where: ACT@FUNCTION, such as
   exit@fmi2DoStep (from the second step on). The initialization and finalization of the library, which know no GUID,
   find ACT@constructor and ACT@destructor in the resources. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <fenv.h>
#include <locale.h>
#include <math.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

typedef void *Component;
typedef int Status;
typedef void (*Logger)(void *, const char *, Status, const char *, const char *, ...);
typedef struct {
    Logger logger;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*finished)(void *, Status);
    void *environment;
} Callbacks;

typedef struct {
    char act[256];
    const Callbacks *callbacks;
    double u, x, t;
} Model;

static void *later(void *unused) {
    (void)unused;
    usleep(50000);
    abort();
    return NULL;
}

static int deep(int n) {
    volatile char room[4096];
    room[0] = (char)n;
    return deep(n + 1) + room[0];
}

/* Writes over all memory that is shared with whoever watches. */
static void forge(void) {
    FILE *maps = fopen("/proc/self/maps", "r");
    char line[1024];
    while (fgets(line, sizeof line, maps)) {
        unsigned long from, to;
        if (!strstr(line, "pilotage-run-") || !strstr(line, "rw-s")) continue;
        if (sscanf(line, "%lx-%lx", &from, &to) == 2) memset((void *)from, 0xff, to - from);
    }
    fclose(maps);
}

/* Empties all files that are shared with whoever watches, by every path to them. */
static void shorten(void) {
    char line[4096], path[64], name[4096];
    FILE *maps = fopen("/proc/self/maps", "r");
    while (fgets(line, sizeof line, maps)) {
        char *from = strchr(line, '/');
        if (!from || !strstr(line, "rw-s")) continue;
        from[strcspn(from, "\n")] = 0;
        if (truncate(from, 0)) continue;
    }
    fclose(maps);
    pid_t who[] = {getpid(), getppid()};
    for (int i = 0; i < 2; i++)
        for (int k = 3; k < 256; k++) {
            snprintf(path, sizeof path, "/proc/%d/fd/%d", who[i], k);
            memset(name, 0, sizeof name);
            if (readlink(path, name, sizeof name - 1) < 0 || !strstr(name, "pilotage-run-")) continue;
            if (truncate(path, 0)) continue;
        }
}

/* Takes away all memory that is shared with whoever watches. */
static void unmap(void) {
    FILE *maps = fopen("/proc/self/maps", "r");
    char line[1024];
    while (fgets(line, sizeof line, maps)) {
        unsigned long from, to;
        if (!strstr(line, "pilotage-run-") || !strstr(line, "rw-s")) continue;
        if (sscanf(line, "%lx-%lx", &from, &to) == 2) munmap((void *)from, to - from);
    }
    fclose(maps);
}

static void act(const char *what, Model *m) {
    if (!strcmp(what, "abort")) abort();
    if (!strcmp(what, "segv")) *(volatile int *)8 = 1;
    if (!strcmp(what, "fpe")) raise(SIGFPE);
    if (!strcmp(what, "kill")) raise(SIGKILL);
    if (!strcmp(what, "stack")) deep(0);
    if (!strcmp(what, "exit")) exit(0);
    if (!strcmp(what, "exit3")) exit(3);
    if (!strcmp(what, "_exit")) _exit(0);
    if (!strcmp(what, "exec")) execl("/bin/true", "true", (char *)NULL);
    if (!strcmp(what, "hang")) for (;;) sleep(1);
    if (!strcmp(what, "deaf")) {
        sigset_t all;
        sigfillset(&all);
        sigprocmask(SIG_BLOCK, &all, NULL);
        for (int i = 1; i < 32; i++) signal(i, SIG_IGN);
        for (;;) sleep(1);
    }
    if (!strcmp(what, "spin")) for (volatile int i = 0;; i++) {}
    if (!strcmp(what, "fork")) {
        /* A helper that keeps what it inherited. */
        if (fork() == 0) { sleep(30); _exit(0); }
    }
    if (!strcmp(what, "forkhang")) {
        if (fork() == 0) { sleep(30); _exit(0); }
        for (;;) sleep(1);
    }
    if (!strcmp(what, "thread")) {
        pthread_t t;
        pthread_create(&t, NULL, later, NULL);
        sleep(1);
    }
    if (!strcmp(what, "close")) for (int i = 0; i < 256; i++) close(i);
    if (!strcmp(what, "closeout")) { close(1); close(2); }
    if (!strcmp(what, "steal"))
        for (int i = 3; i < 256; i++) {
            /* Closed twice, as a faulty library does, and opened anew as its log. */
            char path[64];
            struct stat told;
            if (fstat(i, &told) || !S_ISREG(told.st_mode)) continue;
            snprintf(path, sizeof path, "/proc/self/fd/%d", i);
            char name[4096] = {0};
            if (readlink(path, name, sizeof name - 1) < 0 || !strstr(name, "r.csv")) continue;
            close(i);
            if (open("log.txt", O_CREAT | O_RDWR, 0644) != i) abort();
        }
    if (!strcmp(what, "scribble") || !strcmp(what, "cut"))
        for (int i = 3; i < 256; i++) {
            /* A descriptor that it keeps though it is closed, and somebody else's by now. */
            char path[64], name[4096] = {0};
            snprintf(path, sizeof path, "/proc/self/fd/%d", i);
            if (readlink(path, name, sizeof name - 1) < 0 || !strstr(name, "r.csv")) continue;
            if (!strcmp(what, "scribble")) { if (write(i, "hello\n", 6) != 6) abort(); }
            else if (ftruncate(i, 0)) abort();
        }
    if (!strcmp(what, "forkboth")) fork();
    if (!strcmp(what, "term")) kill(getpid(), SIGTERM);
    if (!strcmp(what, "hangup")) kill(getpid(), SIGHUP);
    if (!strcmp(what, "chdir")) { if (chdir("/")) abort(); }
    if (!strcmp(what, "umask")) umask(0777);
    if (!strcmp(what, "memory")) for (int i = 0; i < 400; i++) memset(malloc(1000000), i + 1, 1000000);
    if (!strcmp(what, "forge")) forge();
    if (!strcmp(what, "shorten")) shorten();
    if (!strcmp(what, "unmap")) unmap();
    if (!strcmp(what, "locale")) setlocale(LC_ALL, "C.UTF-8");
    if (!strcmp(what, "rounding")) fesetround(FE_UPWARD);
    if (!strcmp(what, "handlers")) { signal(SIGINT, SIG_IGN); signal(SIGTERM, SIG_IGN); }
    if (!strcmp(what, "latin1")) { puts("Initialisierung l\xe4uft"); fflush(stdout); }
    if (!strcmp(what, "flood")) {
        for (int i = 0; i < 200000; i++) puts("0123456789 0123456789 0123456789 0123456789 0123456789 0123456789");
        fflush(stdout);
    }
    if (!strcmp(what, "memory")) for (;;) memset(malloc(1 << 20), 1, 1 << 20);
    if (!m) return;
    if (!strcmp(what, "nan")) m->x = NAN;
    if (!strcmp(what, "controls"))
        m->callbacks->logger(m->callbacks->environment, "a", 1, "logStatusWarning", "\033[2Jred \a bell\r");
    if (!strcmp(what, "wide"))
        m->callbacks->logger(m->callbacks->environment, "a", 1, "logStatusWarning", "%2147483647d", 1);
    if (!strcmp(what, "stores")) {
        /* The conversion n behind a character of two bytes. */
        int v = -1;
        m->callbacks->logger(m->callbacks->environment, "a", 1, "logStatusWarning", "ab%\303\251%n", &v);
        if (v != -1) abort();
    }
    if (!strcmp(what, "status77"))
        m->callbacks->logger(m->callbacks->environment, "a", 77, "logStatusWarning", "odd");
    if (!strcmp(what, "long")) {
        char *text = malloc(200000001);
        memset(text, 'x', 200000000);
        text[200000000] = 0;
        m->callbacks->logger(m->callbacks->environment, "a", 1, "logStatusWarning", text);
        free(text);
    }
}

/* Does what the text says, if it is for this place. */
static void at(const char *text, const char *place, Model *m) {
    const char *mark = strchr(text, '@');
    char what[64] = {0};
    if (!mark || mark - text > 60 || strcmp(mark + 1, place)) return;
    memcpy(what, text, (size_t)(mark - text));
    act(what, m);
}

/* The same of the text in the resources. */
static void of_resources(const char *place) {
    Dl_info info;
    char path[4096], text[256] = {0};
    if (!dladdr((void *)of_resources, &info)) return;
    snprintf(path, sizeof path, "%s", info.dli_fname);
    for (int k = 0; k < 3; k++) { char *slash = strrchr(path, '/'); if (slash) *slash = 0; }
    strncat(path, "/resources/act", sizeof path - strlen(path) - 1);
    FILE *file = fopen(path, "r");
    if (!file) return;
    if (fgets(text, sizeof text, file)) at(text, place, NULL);
    fclose(file);
}

__attribute__((constructor)) static void constructor(void) { of_resources("constructor"); }
__attribute__((destructor)) static void destructor(void) { of_resources("destructor"); }

#define EXPORT __attribute__((visibility("default")))
#define HERE(m) at((m)->act, __func__, (m))

EXPORT const char *fmi2GetVersion(void) { of_resources(__func__); return "2.0"; }
EXPORT const char *fmi2GetTypesPlatform(void) { of_resources(__func__); return "default"; }
EXPORT Component fmi2Instantiate(const char *name, int kind, const char *guid, const char *resources,
                                 const Callbacks *callbacks, int visible, int logging) {
    (void)name; (void)kind; (void)resources; (void)visible; (void)logging;
    /* The importer appends to the GUID to see whether it is looked at. */
    if (guid[strlen(guid) - 1] == '!') return NULL;
    Model *m = calloc(1, sizeof *m);
    strncpy(m->act, guid, sizeof m->act - 1);
    m->callbacks = callbacks;
    m->x = 1;
    HERE(m);
    return m;
}
EXPORT void fmi2FreeInstance(Component c) { Model *m = c; HERE(m); free(m); }
EXPORT Status fmi2SetDebugLogging(Component c, int on, size_t n, const char *const *names) {
    (void)c; (void)on; (void)n; (void)names; return 0;
}
EXPORT Status fmi2SetupExperiment(Component c, int a, double b, double t, int d, double e) {
    (void)a; (void)b; (void)d; (void)e;
    Model *m = c; m->t = t; HERE(m); return 0;
}
EXPORT Status fmi2EnterInitializationMode(Component c) { Model *m = c; HERE(m); return 0; }
EXPORT Status fmi2ExitInitializationMode(Component c) { Model *m = c; HERE(m); return 0; }
EXPORT Status fmi2Terminate(Component c) { Model *m = c; HERE(m); return 0; }
EXPORT Status fmi2Reset(Component c) { Model *m = c; HERE(m); m->u = 0; m->x = 1; return 0; }
EXPORT Status fmi2DoStep(Component c, double t, double h, int final) {
    (void)final;
    Model *m = c;
    m->x = m->u + (m->x - m->u) * exp(-h);
    m->t = t + h;
    if (t > 0.15) HERE(m);
    return 0;
}
EXPORT Status fmi2GetReal(Component c, const unsigned *vr, size_t n, double *to) {
    Model *m = c; HERE(m);
    for (size_t i = 0; i < n; i++) {
        if (vr[i] > 1) return 3;
        to[i] = vr[i] ? m->x : m->u;
    }
    if (!strcmp(m->act, "over@values")) for (size_t i = n; i < n + 8; i++) to[i] = 1e299;
    return 0;
}
EXPORT Status fmi2SetReal(Component c, const unsigned *vr, size_t n, const double *from) {
    Model *m = c; HERE(m);
    for (size_t i = 0; i < n; i++) {
        if (vr[i] > 1) return 3;
        if (vr[i]) m->x = from[i]; else m->u = from[i];
    }
    return 0;
}
EXPORT Status fmi2GetFMUstate(Component c, void **state) {
    Model *m = c; HERE(m);
    if (!strcmp(m->act, "null@state")) { *state = NULL; return 0; }
    if (!*state) *state = malloc(sizeof *m);
    memcpy(*state, m, sizeof *m);
    return 0;
}
EXPORT Status fmi2SetFMUstate(Component c, void *state) { Model *m = c; HERE(m); memcpy(m, state, sizeof *m); return 0; }
EXPORT Status fmi2FreeFMUstate(Component c, void **state) { (void)c; free(*state); *state = NULL; return 0; }
EXPORT Status fmi2SerializedFMUstateSize(Component c, void *state, size_t *size) {
    (void)state;
    Model *m = c; HERE(m);
    *size = strcmp(m->act, "huge@state") ? sizeof *m : (size_t)1000000000000000000;
    return 0;
}
EXPORT Status fmi2SerializeFMUstate(Component c, void *state, char *bytes, size_t n) {
    (void)c; if (n < sizeof(Model)) return 3; memcpy(bytes, state, sizeof(Model)); return 0;
}
EXPORT Status fmi2DeSerializeFMUstate(Component c, const char *bytes, size_t n, void **state) {
    (void)c; if (n < sizeof(Model)) return 3;
    *state = malloc(sizeof(Model)); memcpy(*state, bytes, sizeof(Model)); return 0;
}

/* What an importer may look for, and nothing asks. */
#define STUB(name) EXPORT Status name(void) { return 3; }
STUB(fmi2GetInteger) STUB(fmi2GetBoolean) STUB(fmi2GetString) STUB(fmi2SetInteger) STUB(fmi2SetBoolean)
STUB(fmi2SetString) STUB(fmi2GetStatus) STUB(fmi2GetRealStatus) STUB(fmi2GetIntegerStatus) STUB(fmi2GetBooleanStatus)
STUB(fmi2GetStringStatus) STUB(fmi2CancelStep) STUB(fmi2GetDirectionalDerivative) STUB(fmi2SetRealInputDerivatives)
STUB(fmi2GetRealOutputDerivatives)
