/* take, give and the entry of a program that has them alone: over a system's calls where there is a C library, by hand on
   an ARM controller without one, for an emulator that lends it Linux's calls (qemu-arm). The program defines `run`. */

#include <stddef.h>
#include <stdint.h>

static int run(void);

#if defined(__arm__)
static int32_t call(int32_t number, int32_t a, int32_t b, int32_t c)
{
    register int32_t r0 __asm__("r0") = a;
    register int32_t r1 __asm__("r1") = b;
    register int32_t r2 __asm__("r2") = c;
    register int32_t r3 __asm__("r3") = number;
    __asm__ volatile("mov ip, r7\n\tmov r7, r3\n\tsvc 0\n\tmov r7, ip" : "+r"(r0) : "r"(r1), "r"(r2), "r"(r3) : "ip", "memory");
    return r0;
}

static int32_t some(int put, void *to, size_t n)
{
    return call(put ? 4 : 3, put, (int32_t)(intptr_t)to, (int32_t)n);
}

void _start(void);
void _start(void)
{
    call(1, run(), 0, 0);
    for (;;) {
    }
}
#else
#include <unistd.h>

static int32_t some(int put, void *to, size_t n)
{
    return (int32_t)(put ? write(1, to, n) : read(0, to, n));
}

int main(void)
{
    return run();
}
#endif

/* All n bytes; 0 where they are not to be had. */
static int through(int put, void *to, size_t n)
{
    char *at = to;
    while (n > 0) {
        const int32_t done = some(put, at, n);
        if (done <= 0) return 0;
        at += done;
        n -= (size_t)done;
    }
    return 1;
}

static int take(void *to, size_t n)
{
    return through(0, to, n);
}

static int give(void *from, size_t n)
{
    return through(1, from, n);
}
