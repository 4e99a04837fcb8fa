/* The three functions of C's library that gcc calls unasked, for some loops and assignments of structures: a port to a
   bare processor has no library behind it. Byte by byte. */
#include <stddef.h>
#include <stdint.h>

void *memcpy(void *to, const void *from, size_t count);
void *memmove(void *to, const void *from, size_t count);
void *memset(void *to, int value, size_t count);

void *memcpy(void *to, const void *from, size_t count)
{
    uint8_t *target = to;
    const uint8_t *source = from;
    for (size_t k = 0u; k < count; k++) {
        target[k] = source[k];
    }
    return to;
}

void *memmove(void *to, const void *from, size_t count)
{
    uint8_t *target = to;
    const uint8_t *source = from;
    if ((uintptr_t)to <= (uintptr_t)from) {
        return memcpy(to, from, count);
    }
    for (size_t k = count; k > 0u; k--) {
        target[k - 1u] = source[k - 1u];
    }
    return to;
}

void *memset(void *to, int value, size_t count)
{
    uint8_t *target = to;
    for (size_t k = 0u; k < count; k++) {
        target[k] = (uint8_t)value;
    }
    return to;
}
