/*
 * A disk that fails, put before the C library by the tests of faults.
 *
 * ASPERITY_DISK_KILL=n    the process is killed at its n-th change of a file, half of what it was about to write being written
 * ASPERITY_DISK_BYTES=n   the disk takes n bytes, then it is full
 * ASPERITY_DISK_SAYS=file each process adds a line at its end: how many changes there were, and of how many bytes
 *
 * Changes are writes to regular files, renames, and what comes before and after each wait for the disk.
 */

#define _GNU_SOURCE

#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

static atomic_long changes;
static atomic_long taken;

static long told(const char *name) {
    const char *text = getenv(name);
    return text != NULL && *text != '\0' ? atol(text) : -1;
}

static int is_file(int fd) {
    struct stat about;
    return fstat(fd, &about) == 0 && S_ISREG(about.st_mode);
}

/* Whether this is the change at which the process is killed. */
static int is_the_last(void) {
    return atomic_fetch_add(&changes, 1) + 1 == told("ASPERITY_DISK_KILL");
}

typedef ssize_t Write(int, const void *, size_t);
typedef int Wait(int);

static ssize_t really_write(int fd, const void *bytes, size_t len) {
    static Write *next;
    if (next == NULL)
        next = (Write *)dlsym(RTLD_NEXT, "write");
    return next(fd, bytes, len);
}

ssize_t write(int fd, const void *bytes, size_t len) {
    if (!is_file(fd))
        return really_write(fd, bytes, len);
    if (is_the_last()) {
        really_write(fd, bytes, len / 2);
        raise(SIGKILL);
    }
    long room = told("ASPERITY_DISK_BYTES");
    long before = atomic_fetch_add(&taken, (long)len);
    if (room >= 0) {
        if (before >= room && len > 0) {
            errno = ENOSPC;
            return -1;
        }
        if (before + (long)len > room)
            len = (size_t)(room - before);
    }
    return really_write(fd, bytes, len);
}

ssize_t writev(int fd, const struct iovec *parts, int count) {
    ssize_t all = 0;
    for (int i = 0; i < count; i++) {
        ssize_t some = write(fd, parts[i].iov_base, parts[i].iov_len);
        if (some < 0)
            return all > 0 ? all : some;
        all += some;
        if ((size_t)some < parts[i].iov_len)
            break;
    }
    return all;
}

static int waits(const char *name, int fd) {
    Wait *next = (Wait *)dlsym(RTLD_NEXT, name);
    if (is_the_last())
        raise(SIGKILL);
    int answer = next(fd);
    if (is_the_last())
        raise(SIGKILL);
    return answer;
}

int fsync(int fd) {
    return waits("fsync", fd);
}

int fdatasync(int fd) {
    return waits("fdatasync", fd);
}

int rename(const char *from, const char *to) {
    int (*next)(const char *, const char *) = (int (*)(const char *, const char *))dlsym(RTLD_NEXT, "rename");
    if (is_the_last())
        raise(SIGKILL);
    return next(from, to);
}

__attribute__((destructor)) static void say(void) {
    const char *path = getenv("ASPERITY_DISK_SAYS");
    FILE *file = path != NULL && *path != '\0' ? fopen(path, "a") : NULL;
    if (file == NULL)
        return;
    fprintf(file, "%ld %ld\n", atomic_load(&changes), atomic_load(&taken));
    fclose(file);
}
