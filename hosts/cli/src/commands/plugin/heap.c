/*
 * Counts what one thread does to the heap, while it is told to. Put before the system's library (LD_PRELOAD) in the process that
 * checks a plugin: a plugin has an allocator of its own language, and all of them end here.
 *
 * Forwards to the names that glibc keeps for this, so that nothing has to be looked up while memory is asked for. What a plugin
 * takes from the system itself (mmap), or from an allocator that is linked into it, does not come by.
 */

#include <errno.h>
#include <stddef.h>
#include <stdint.h>

extern void *__libc_malloc(size_t size);
extern void *__libc_calloc(size_t count, size_t size);
extern void *__libc_realloc(void *at, size_t size);
extern void *__libc_memalign(size_t alignment, size_t size);
extern void *__libc_valloc(size_t size);
extern void *__libc_pvalloc(size_t size);
extern void __libc_free(void *at);

/* Of this kind, a variable of a thread needs no memory when it is first touched. */
#define OF_A_THREAD static __thread __attribute__((tls_model("initial-exec")))

OF_A_THREAD uint64_t counting;
OF_A_THREAD uint64_t taken;
OF_A_THREAD uint64_t freed;

void asperity_heap_begin(void) {
    taken = 0;
    freed = 0;
    counting = 1;
}

void asperity_heap_end(uint64_t *how_often_taken, uint64_t *how_often_freed) {
    counting = 0;
    *how_often_taken = taken;
    *how_often_freed = freed;
}

void *malloc(size_t size) {
    taken += counting;
    return __libc_malloc(size);
}

void *calloc(size_t count, size_t size) {
    taken += counting;
    return __libc_calloc(count, size);
}

void *realloc(void *at, size_t size) {
    if (at != NULL && size == 0)
        freed += counting;
    else
        taken += counting;
    return __libc_realloc(at, size);
}

void *memalign(size_t alignment, size_t size) {
    taken += counting;
    return __libc_memalign(alignment, size);
}

void *aligned_alloc(size_t alignment, size_t size) {
    taken += counting;
    return __libc_memalign(alignment, size);
}

int posix_memalign(void **at, size_t alignment, size_t size) {
    taken += counting;
    if (alignment % sizeof(void *) != 0 || alignment == 0 || (alignment & (alignment - 1)) != 0)
        return EINVAL;
    void *found = __libc_memalign(alignment, size);
    if (found == NULL)
        return ENOMEM;
    *at = found;
    return 0;
}

void *valloc(size_t size) {
    taken += counting;
    return __libc_valloc(size);
}

void *pvalloc(size_t size) {
    taken += counting;
    return __libc_pvalloc(size);
}

void free(void *at) {
    if (at != NULL)
        freed += counting;
    __libc_free(at);
}
