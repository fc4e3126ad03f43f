/* The start of programs, beside old_glibc.c. Until 2.34 a program called its own constructors; since then libc does so, if the
   program gives no function for it: with the start files of a new glibc nobody would on an old system. */

typedef void constructor(int, char **, char **);
typedef int start(int (*)(int, char **, char **), int, char **, constructor *, void (*)(void), void (*)(void), void *);

extern constructor *__init_array_start[] __attribute__((visibility("hidden")));
extern constructor *__init_array_end[] __attribute__((visibility("hidden")));

static void construct(int argc, char **argv, char **envp)
{
    for (constructor **own = __init_array_start; own != __init_array_end; own++)
        (*own)(argc, argv, envp);
}

extern start real_start;
__asm__(".symver real_start, __libc_start_main@GLIBC_2.2.5");

start old_start __asm__("__libc_start_main") __attribute__((visibility("hidden")));
int old_start(int (*main)(int, char **, char **), int argc, char **argv, constructor *init, void (*fini)(void),
              void (*loader_fini)(void), void *stack_end)
{
    return real_start(main, argc, argv, init ? init : construct, fini, loader_fini, stack_end);
}
