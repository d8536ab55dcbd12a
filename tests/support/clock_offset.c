/* Preloaded, it gives a process another real-time clock: CLOCK_OFFSET_NS nanoseconds are added, with CLOCK_OFFSET_FROM from
   the moment on in which that file is there; each process then makes one of that name with its id. The monotonic clock
   stays. */
#define _GNU_SOURCE
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

#define NS 1000000000LL

static long long offset(void) {
    static int told;
    const char *offset = getenv("CLOCK_OFFSET_NS"), *mark = getenv("CLOCK_OFFSET_FROM");
    char name[4096];
    if (!offset || (mark && access(mark, F_OK)))
        return 0;
    if (mark && !told && (told = 1) && snprintf(name, sizeof name, "%s.%d", mark, (int)getpid()) > 0)
        close(open(name, O_CREAT | O_WRONLY, 0600));
    return atoll(offset);
}

int clock_gettime(clockid_t id, struct timespec *now) {
    int failed = syscall(SYS_clock_gettime, id, now);
    if (!failed && id == CLOCK_REALTIME) {
        long long ns = now->tv_sec * NS + now->tv_nsec + offset();
        now->tv_sec = ns / NS;
        now->tv_nsec = ns % NS;
    }
    return failed;
}

int gettimeofday(struct timeval *restrict now, void *restrict zone) {
    struct timespec exact;
    (void)zone;
    clock_gettime(CLOCK_REALTIME, &exact);
    now->tv_sec = exact.tv_sec;
    now->tv_usec = exact.tv_nsec / 1000;
    return 0;
}

time_t time(time_t *now) {
    struct timespec exact;
    clock_gettime(CLOCK_REALTIME, &exact);
    if (now)
        *now = exact.tv_sec;
    return exact.tv_sec;
}
