/* Wine 8 lacks this library of Windows, of which Rust's standard library takes the seeds of its hash maps. For tests alone. */
#include <stddef.h>

__declspec(dllexport) int __stdcall ProcessPrng(unsigned char *bytes, size_t count) {
    for (size_t k = 0; k < count; k++)
        bytes[k] = (unsigned char)(37 * k + 11);
    return 1;
}
