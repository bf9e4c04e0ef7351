/* Faults of a file system, for a program that is started with this library in LD_PRELOAD. Calls that change files below
 * FAULT_ROOT are counted from 1, and at number FAULT_AT comes what FAULT names:
 *
 *   kill, term, int    the signal, before the call
 *   torn               half of the next write, then SIGKILL
 *   full               nothing fits on the disk from then on: half of the next write does
 *   short              every write from then on writes half of what it is given
 *   sync, rename       the next call of that kind fails
 *   denied             from then on no name is made, changed or removed
 *
 * FAULT_TRACE is a file that gets a letter for each call, FAULT_KEEP a folder that gets a link to each file as it is
 * given its name or is removed. The clock stands still: what a run writes about the time is the same in each run. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))
#define FILES 4096

static const char *root, *kind, *keep;
static long at;
static int trace = -1;
static atomic_long calls, kept;
static atomic_int struck;
/* Which open files are below the root and written to. */
static atomic_char watched[FILES];

__attribute__((constructor)) static void begin(void) {
    const char *number = getenv("FAULT_AT"), *file = getenv("FAULT_TRACE");
    root = getenv("FAULT_ROOT");
    kind = getenv("FAULT") ? getenv("FAULT") : "none";
    keep = getenv("FAULT_KEEP");
    at = number ? atol(number) : 0;
    if (file) trace = REAL(open)(file, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
}

static int is(const char *name) { return strcmp(kind, name) == 0; }

static int below(const char *path) {
    return root && (path[0] != '/' || strncmp(path, root, strlen(root)) == 0);
}

/* Count a call, of the kind that the letter stands for. The error it is to fail with, or 0. */
static int strike(char what) {
    long number = atomic_fetch_add(&calls, 1) + 1;
    if (trace >= 0 && REAL(write)(trace, &what, 1) != 1) abort();
    if (at == 0 || number < at) return 0;
    if (number == at) {
        if (is("kill")) kill(getpid(), SIGKILL);
        if (is("term")) kill(getpid(), SIGTERM);
        if (is("int")) kill(getpid(), SIGINT);
    }
    if (is("full") && strchr("omw", what)) return ENOSPC;
    if (is("denied") && strchr("omru", what)) return EACCES;
    int once = (is("sync") && what == 's') || (is("rename") && what == 'r');
    return once && !atomic_exchange(&struck, 1) ? EIO : 0;
}

static int failed(int error) {
    errno = error;
    return error ? -1 : 0;
}

static void keep_file(const char *path, const char *name) {
    struct stat found;
    char link_name[4096];
    const char *slash = strrchr(name, '/');
    const char *base = slash ? slash + 1 : name;
    if (!keep || base[0] == '.' || lstat(path, &found) || !S_ISREG(found.st_mode)) return;
    snprintf(link_name, sizeof link_name, "%s/%ld-%s", keep, atomic_fetch_add(&kept, 1), base);
    if (link(path, link_name)) abort();
}

static int opened(int folder, const char *path, int flags, mode_t mode) {
    int counts = folder == AT_FDCWD && below(path) && (flags & O_ACCMODE) != O_RDONLY;
    int is_new = counts && (flags & O_CREAT) && REAL(access)(path, F_OK);
    if (is_new && failed(strike('o'))) return -1;
    int file = REAL(openat)(folder, path, flags, mode);
    if (file >= 0 && file < FILES) watched[file] = counts;
    return file;
}

#define MODE                                                                                                            \
    va_list more;                                                                                                       \
    va_start(more, flags);                                                                                              \
    mode_t mode = (flags & O_CREAT) || (flags & O_TMPFILE) == O_TMPFILE ? va_arg(more, mode_t) : 0;                     \
    va_end(more)

int open(const char *path, int flags, ...) { MODE; return opened(AT_FDCWD, path, flags, mode); }
int open64(const char *path, int flags, ...) { MODE; return opened(AT_FDCWD, path, flags, mode); }
int openat(int folder, const char *path, int flags, ...) { MODE; return opened(folder, path, flags, mode); }
int openat64(int folder, const char *path, int flags, ...) { MODE; return opened(folder, path, flags, mode); }

int close(int file) {
    if (file >= 0 && file < FILES) watched[file] = 0;
    return REAL(close)(file);
}

ssize_t write(int file, const void *bytes, size_t count) {
    if (file < 0 || file >= FILES || !watched[file]) return REAL(write)(file, bytes, count);
    int error = strike('w');
    int reached = at && calls >= at, first = reached && !atomic_exchange(&struck, 1);
    size_t half = count / 2;
    if (is("torn") && reached) {
        if (half && REAL(write)(file, bytes, half) < 0) abort();
        kill(getpid(), SIGKILL);
    }
    if (is("short") && reached && half) count = half;
    if (error && first && half) return REAL(write)(file, bytes, half);
    return error ? failed(error) : REAL(write)(file, bytes, count);
}

static int synced(int file, int (*real)(int)) {
    int counts = file >= 0 && file < FILES && watched[file];
    return counts && failed(strike('s')) ? -1 : real(file);
}

int fsync(int file) { return synced(file, REAL(fsync)); }
int fdatasync(int file) { return synced(file, REAL(fdatasync)); }

int ftruncate64(int file, off64_t length) {
    int counts = file >= 0 && file < FILES && watched[file];
    return counts && failed(strike('t')) ? -1 : REAL(ftruncate64)(file, length);
}

int rename(const char *from, const char *to) {
    if (below(to)) {
        keep_file(from, to);
        if (failed(strike('r'))) return -1;
    }
    return REAL(rename)(from, to);
}

int mkdir(const char *path, mode_t mode) {
    int counts = below(path) && REAL(access)(path, F_OK);
    return counts && failed(strike('m')) ? -1 : REAL(mkdir)(path, mode);
}

int unlink(const char *path) {
    if (below(path)) {
        keep_file(path, path);
        if (failed(strike('u'))) return -1;
    }
    return REAL(unlink)(path);
}

int rmdir(const char *path) {
    return below(path) && failed(strike('u')) ? -1 : REAL(rmdir)(path);
}

/* Of what is removed below a folder that is open: folders below the root are removed by this program alone. */
int unlinkat(int folder, const char *path, int flags) {
    return root && failed(strike('u')) ? -1 : REAL(unlinkat)(folder, path, flags);
}

/* Far ahead, so that what waits for a time to come waits for good. */
int clock_gettime(clockid_t clock, struct timespec *now) {
    if (clock != CLOCK_REALTIME && clock != CLOCK_MONOTONIC) return REAL(clock_gettime)(clock, now);
    *now = (struct timespec){.tv_sec = 4000000000, .tv_nsec = 0};
    return 0;
}
