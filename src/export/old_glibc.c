/* Functions of newer glibc, made of those of 2.17: old_glibc.rs compiles them and puts them in front of the stand-in for libc, as
   libc_nonshared.a was. They are hidden: only the program or library that is linked with them finds them. */

#define _GNU_SOURCE
#include <link.h>
#include <stddef.h>

/* Names at link time, since the headers may declare the same functions. */
#define HIDDEN(name) __asm__(name) __attribute__((visibility("hidden")))

/* Functions of their own since 2.33. The first argument says which `struct stat` is meant: x86-64 has one. */
enum { STAT_VERSION = 1 };
extern int __xstat64(int, const char *, void *);
extern int __lxstat64(int, const char *, void *);
extern int __fxstat64(int, int, void *);
extern int __fxstatat64(int, int, const char *, void *, int);

int old_stat(const char *, void *) HIDDEN("stat64");
int old_stat(const char *path, void *result) { return __xstat64(STAT_VERSION, path, result); }

int old_lstat(const char *, void *) HIDDEN("lstat64");
int old_lstat(const char *path, void *result) { return __lxstat64(STAT_VERSION, path, result); }

int old_fstat(int, void *) HIDDEN("fstat64");
int old_fstat(int file, void *result) { return __fxstat64(STAT_VERSION, file, result); }

int old_fstatat(int, const char *, void *, int) HIDDEN("fstatat64");
int old_fstatat(int folder, const char *path, void *result, int flags)
{
    return __fxstatat64(STAT_VERSION, folder, path, result, flags);
}

/* `_dl_find_object`, new in 2.35, of <dlfcn.h>: by it the unwinder finds the frames of the function at an address. Older unwinders
   called `dl_iterate_phdr`, as this function does. */
struct found {
    unsigned long long flags;
    void *start, *end;
    struct link_map *link_map;
    void *frames;
    unsigned long long reserved[7];
};

struct question {
    ElfW(Addr) address;
    struct found *answer;
};

static int look(struct dl_phdr_info *object, size_t size, void *asked)
{
    struct question *question = asked;
    const ElfW(Phdr) *segment = NULL, *frames = NULL;
    for (int i = 0; i < object->dlpi_phnum; i++) {
        const ElfW(Phdr) *header = &object->dlpi_phdr[i];
        ElfW(Addr) offset = question->address - object->dlpi_addr - header->p_vaddr;
        if (header->p_type == PT_LOAD && offset < header->p_memsz)
            segment = header;
        if (header->p_type == PT_GNU_EH_FRAME)
            frames = header;
    }
    (void)size;
    if (!segment || !frames)
        return 0;
    *question->answer = (struct found){
        .start = (void *)(object->dlpi_addr + segment->p_vaddr),
        .end = (void *)(object->dlpi_addr + segment->p_vaddr + segment->p_memsz),
        .frames = (void *)(object->dlpi_addr + frames->p_vaddr),
    };
    return 1;
}

int old_find_object(void *, struct found *) HIDDEN("_dl_find_object");
int old_find_object(void *address, struct found *result)
{
    struct question question = {(ElfW(Addr))address, result};
    return dl_iterate_phdr(look, &question) ? 0 : -1;
}
