/* What the simulated board needs of the machine that it runs on: a session's number. */
#define _POSIX_C_SOURCE 200809L

#include <time.h>
#include <unistd.h>

#include "port.h"

uint32_t port_session(void)
{
    static uint32_t sessions;
    struct timespec now = {0};
    (void)clock_gettime(CLOCK_REALTIME, &now);
    sessions++;
    /* Mixed as in splitmix64, so that any two that differ in time, process or order differ here. */
    uint64_t x = ((uint64_t)now.tv_sec * 1000000000u) + (uint64_t)now.tv_nsec;
    x ^= ((uint64_t)(uint32_t)getpid() << 40) ^ ((uint64_t)sessions << 56);
    x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9u;
    x = (x ^ (x >> 27)) * 0x94D049BB133111EBu;
    return (uint32_t)(x >> 32);
}

void port_kick(void)
{
    /* no watchdog */
}
