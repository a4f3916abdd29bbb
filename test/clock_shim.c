/* A system clock that a test sets, for the processes that have this preloaded: the offset in ns stands
   in the file that HC_TEST_CLOCK names. The real clock is everybody's on the machine. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <semaphore.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

static const volatile long long *offset_ns; /* a file that the test writes */

static __attribute__((constructor)) void map_offset(void) {
  const char *path = getenv("HC_TEST_CLOCK");
  int number = path ? open(path, O_RDONLY) : -1;
  if (number >= 0) {
    void *page = mmap(0, 8, PROT_READ, MAP_SHARED, number, 0);
    if (page != MAP_FAILED) offset_ns = page;
    close(number);
  }
}

int clock_gettime(clockid_t clock, struct timespec *now) {
  static int (*real)(clockid_t, struct timespec *);
  if (!real) real = dlsym(RTLD_NEXT, "clock_gettime");
  int status = real(clock, now);
  if (status == 0 && offset_ns && (clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE)) {
    long long t = now->tv_sec * 1000000000LL + now->tv_nsec + *offset_ns;
    now->tv_sec = t / 1000000000LL;
    now->tv_nsec = t % 1000000000LL;
  }
  return status;
}

int gettimeofday(struct timeval *restrict now, void *restrict zone) {
  struct timespec t;
  (void)zone;
  int status = clock_gettime(CLOCK_REALTIME, &t);
  now->tv_sec = t.tv_sec;
  now->tv_usec = t.tv_nsec / 1000;
  return status;
}

time_t time(time_t *now) {
  struct timespec t;
  clock_gettime(CLOCK_REALTIME, &t);
  if (now) *now = t.tv_sec;
  return t.tv_sec;
}

/* Waits until a moment of the system clock, told from the steady one by its size. The kernel does
   not know of our offset, so they are cut into slices: a clock that is set back makes them longer. */
#define SLICE_NS 20000000LL
static long long now_ns(clockid_t clock) {
  struct timespec t;
  clock_gettime(clock, &t);
  return t.tv_sec * 1000000000LL + t.tv_nsec;
}

static int is_system_time(const struct timespec *t) { return t->tv_sec > 1000000000; }

/* The next slice of a wait, in the kernel's system time; 0 when the moment has come. */
static int slice(const struct timespec *until, struct timespec *end) {
  long long offset = offset_ns ? *offset_ns : 0;
  long long left = until->tv_sec * 1000000000LL + until->tv_nsec - now_ns(CLOCK_REALTIME);
  if (left <= 0) return 0;
  if (left > SLICE_NS) left = SLICE_NS;
  long long t = now_ns(CLOCK_REALTIME) - offset + left;
  end->tv_sec = t / 1000000000LL;
  end->tv_nsec = t % 1000000000LL;
  return 1;
}

#define SLICED(call)                                                          \
  struct timespec end;                                                        \
  int status;                                                                 \
  do {                                                                        \
    if (!slice(until, &end)) end = (struct timespec){0, 0};                   \
    status = call;                                                            \
  } while (status == ETIMEDOUT && end.tv_sec != 0);                           \
  return status;

int pthread_cond_timedwait(pthread_cond_t *restrict cond, pthread_mutex_t *restrict mutex,
                           const struct timespec *restrict until) {
  static int (*real)(pthread_cond_t *, pthread_mutex_t *, const struct timespec *);
  if (!real) real = dlvsym(RTLD_NEXT, "pthread_cond_timedwait", "GLIBC_2.3.2");
  if (!is_system_time(until)) return real(cond, mutex, until);
  SLICED(real(cond, mutex, &end))
}

int pthread_mutex_timedlock(pthread_mutex_t *restrict mutex, const struct timespec *restrict until) {
  static int (*real)(pthread_mutex_t *, const struct timespec *);
  if (!real) real = dlsym(RTLD_NEXT, "pthread_mutex_timedlock");
  if (!is_system_time(until)) return real(mutex, until);
  SLICED(real(mutex, &end))
}

int sem_timedwait(sem_t *restrict sem, const struct timespec *restrict until) {
  static int (*real)(sem_t *, const struct timespec *);
  if (!real) real = dlsym(RTLD_NEXT, "sem_timedwait");
  if (!is_system_time(until)) return real(sem, until);
  struct timespec end;
  int status;
  do {
    if (!slice(until, &end)) end = (struct timespec){0, 0};
    status = real(sem, &end);
  } while (status != 0 && errno == ETIMEDOUT && end.tv_sec != 0);
  return status;
}
