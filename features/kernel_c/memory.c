/* memcpy for firmware without a C library: the kernel calls it to copy the axes. Blocks of four words go first, each
   with one load and one store on a Cortex-M3; then what is left, byte by byte. */
#include <stddef.h>
#include <stdint.h>

void *memcpy(void *restrict target, const void *restrict source, size_t size);

typedef struct {
    uint32_t words[4];
} __attribute__((may_alias)) block;

void *memcpy(void *restrict target, const void *restrict source, size_t size)
{
    unsigned char *to = target;
    const unsigned char *from = source;
    if ((((uintptr_t)to | (uintptr_t)from) & 3U) == 0U) {
        block *blocks = (block *)(void *)to;
        const block *sources = (const block *)(const void *)from;
        for (; size >= sizeof(block); size -= sizeof(block)) {
            *blocks++ = *sources++;
        }
        to = (unsigned char *)blocks;
        from = (const unsigned char *)sources;
    }
    for (; size > 0U; size--) {
        *to++ = *from++;
    }
    return target;
}
