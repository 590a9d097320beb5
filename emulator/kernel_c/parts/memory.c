/* memcpy for firmware without a C library: gcc calls it to copy the axes. Whole blocks go as four words at once, which
   a Cortex-M3 loads and stores with one instruction each. Compile with -fno-strict-aliasing if it is inlined elsewhere. */
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
        for (; size >= 2U * sizeof(block); size -= 2U * sizeof(block)) {
            block *const blocks = (block *)(void *)to;
            const block *const sources = (const block *)(const void *)from;
            blocks[0] = sources[0];
            blocks[1] = sources[1];
            to += 2U * sizeof(block);
            from += 2U * sizeof(block);
        }
    }
    for (; size > 0U; size--) {
        *to++ = *from++;
    }
    return target;
}
