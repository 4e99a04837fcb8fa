/* bed-host: the firmware on this machine, with a simulated plant, behind a pseudo-terminal or a socket.

       bed-host [--log FILE] [--line NUMBER]

   Prints the terminal's name as its first line; whoever opens it talks to the bed. Free-running ticks are the plant's
   periods on CLOCK_MONOTONIC; those that were missed are made up for. A client may come and go.

   --log FILE      every output that changes: time ns (CLOCK_MONOTONIC), tick, i or v, counts
   --line NUMBER   no terminal: the line is this connected socket, inherited from the program that started it; the bed
                   ends when nobody holds the other end
   SIGHUP          a reboot: power gone and come back
   SIGUSR1         a reset by the watchdog
   SIGTERM         ends */
#define _GNU_SOURCE /* ppoll */

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include "board.h"
#include "plant.h"

/* s: a machine that slept for longer goes on from now */
#define LONGEST_GAP 1.0

static volatile sig_atomic_t wanted; /* the last signal that came, 0 once it is done */
static FILE *log_file;

static void on_signal(int number)
{
    if (wanted != SIGTERM) { /* of several that came together, the end */
        wanted = number;
    }
}

static int64_t now_ns(void)
{
    struct timespec now = {0};
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return ((int64_t)now.tv_sec * 1000000000) + now.tv_nsec;
}

static void log_output(char output, int32_t counts)
{
    static int32_t voltage = INT32_MIN, current = INT32_MIN;
    int32_t *last = (output == 'v') ? &voltage : &current;
    if (counts != *last) {
        *last = counts;
        (void)fprintf(log_file, "%lld %u %c %d\n", (long long)now_ns(), (unsigned)board_ticks(), output, (int)counts);
    }
}

static int fail(const char *what)
{
    (void)fprintf(stderr, "bed-host: %s: %s\n", what, strerror(errno));
    return 1;
}

/* Opens a terminal that passes bytes as they are. Answers the bed's side, -1 with errno; the client's side stays open
   here, so that a client that goes is not an error. */
static int open_terminal(void)
{
    const int ours = posix_openpt(O_RDWR | O_NOCTTY);
    if ((ours < 0) || (grantpt(ours) != 0) || (unlockpt(ours) != 0)) {
        return -1;
    }
    const int theirs = open(ptsname(ours), O_RDWR | O_NOCTTY);
    struct termios mode;
    if ((theirs < 0) || (tcgetattr(theirs, &mode) != 0)) {
        return -1;
    }
    cfmakeraw(&mode);
    return (tcsetattr(theirs, TCSANOW, &mode) == 0) ? ours : -1;
}

/* What waits in the bed goes out as far as the terminal takes it; what it does not take waits in `left`. */
static void send(int line, uint8_t *left, size_t room, size_t *held)
{
    for (;;) {
        *held += board_send(&left[*held], room - *held);
        if (*held == 0u) {
            return;
        }
        const ssize_t went = write(line, left, *held);
        if (went <= 0) {
            return;
        }
        *held -= (size_t)went;
        (void)memmove(left, &left[went], *held);
    }
}

static int run(int line)
{
    const int64_t period = (int64_t)((plant_period * 1e9) + 0.5);
    int64_t due = now_ns() + period;
    uint8_t left[BED_WAITING];
    size_t held = 0u;
    struct pollfd watched = {.fd = line};
    sigset_t none;
    (void)sigemptyset(&none);
    for (;;) {
        if (wanted == SIGTERM) {
            return 0;
        }
        if (wanted != 0) {
            held = 0u;
            board_boot((wanted == SIGUSR1) ? BED_WATCHDOG : BED_POWER);
            wanted = 0;
        }
        struct timespec rest = {0};
        if (!board_is_in_lock_step()) {
            int64_t ahead = due - now_ns();
            if (ahead < -(int64_t)(LONGEST_GAP * 1e9)) {
                due -= ahead;
                ahead = 0;
            }
            while (ahead <= 0) {
                board_tick();
                due += period;
                ahead += period;
            }
            rest.tv_sec = ahead / 1000000000;
            rest.tv_nsec = ahead % 1000000000;
        }
        watched.events = (held > 0u) ? (POLLIN | POLLOUT) : POLLIN;
        const int ready = ppoll(&watched, 1u, board_is_in_lock_step() ? NULL : &rest, &none);
        if ((ready < 0) && (errno != EINTR)) {
            return fail("ppoll");
        }
        if (ready <= 0) {
            continue;
        }
        if ((watched.revents & (POLLIN | POLLHUP)) != 0) {
            uint8_t bytes[256];
            const ssize_t came = read(line, bytes, sizeof bytes);
            if ((came == 0) || ((came < 0) && (errno == ECONNRESET))) { /* a socket's; a terminal is held open here */
                return 0;
            }
            for (ssize_t at = 0; at < came; at++) { /* each answer goes out before the next is made */
                board_receive(&bytes[at], 1u);
                if (bytes[at] == 0u) {
                    send(line, left, sizeof left, &held);
                }
            }
        }
        send(line, left, sizeof left, &held);
    }
}

int main(int count, char **words)
{
    int line = -1;
    for (int k = 1; k < count; k++) {
        char *end = NULL;
        if ((strcmp(words[k], "--line") == 0) && (k + 1 < count) && (line < 0)) {
            k++;
            const long number = strtol(words[k], &end, 10);
            line = ((end == words[k]) || (*end != '\0') || (number < 0) || (number > INT_MAX)) ? -1 : (int)number;
            if ((line < 0) || (fcntl(line, F_GETFD) < 0)) {
                errno = EBADF;
                return fail(words[k]);
            }
        } else if ((strcmp(words[k], "--log") == 0) && (k + 1 < count) && (log_file == NULL)) {
            k++;
            log_file = fopen(words[k], "w");
            if (log_file == NULL) {
                return fail(words[k]);
            }
            (void)setvbuf(log_file, NULL, _IOLBF, 0u);
            board_listener = log_output;
        } else {
            (void)fprintf(stderr, "usage: bed-host [--log FILE] [--line NUMBER]\n");
            return 2;
        }
    }
    /* Signals come while ppoll waits, and at no other time. */
    const int signals[] = {SIGHUP, SIGUSR1, SIGTERM};
    struct sigaction action = {.sa_handler = on_signal};
    sigset_t blocked;
    (void)sigemptyset(&blocked);
    for (size_t k = 0u; k < sizeof signals / sizeof signals[0]; k++) {
        (void)sigaddset(&blocked, signals[k]);
        (void)sigaction(signals[k], &action, NULL);
    }
    (void)sigprocmask(SIG_BLOCK, &blocked, NULL);
    (void)signal(SIGPIPE, SIG_IGN);

    board_boot(BED_POWER);
    if (line < 0) {
        line = open_terminal();
        if (line < 0) {
            return fail("no pseudo-terminal");
        }
        (void)printf("%s\n", ptsname(line));
        if (fflush(stdout) != 0) {
            return fail("standard output");
        }
    }
    return (fcntl(line, F_SETFL, O_NONBLOCK) == 0) ? run(line) : fail("the line");
}
