/* Reads what `viewcell export BAKE --bits FILE` wrote: C99, nothing copied, for little-endian machines. */
#ifndef VIEWCELL_BITS_H
#define VIEWCELL_BITS_H
#include <stdint.h>
#include <string.h>

/* An upright prism: x, y of four corners, counter-clockwise, and z of both ends, in the model's own metres, Z up. */
typedef struct { double plan[4][2], bottom, top; int32_t cell_id, zero; } viewcell_cell;
typedef struct { uint32_t cells, objects, stride; const viewcell_cell *cell; const uint8_t *bits; } viewcell_sets;

/* 0, or -1 where `data` (aligned to 8 bytes, and kept as long as `sets`) is no whole file of this format. */
static int viewcell_open(viewcell_sets *sets, const void *data, uint64_t size) {
    uint32_t head[4];
    if (size < 24 || memcmp(data, "VIEWCELL", 8)) return -1;
    memcpy(head, (const char *)data + 8, sizeof head);
    sets->cells = head[1], sets->objects = head[2], sets->stride = head[3];
    sets->cell = (const viewcell_cell *)((const char *)data + 24);
    sets->bits = (const uint8_t *)(sets->cell + sets->cells);
    return head[0] == 1 && size == 24 + (uint64_t)sets->cells * (sizeof(viewcell_cell) + sets->stride) ? 0 : -1;
}

/* Row of the smallest view cell that holds an eye; -1 if none does: then everything is to be drawn. */
static int64_t viewcell_row(const viewcell_sets *sets, double x, double y, double z) {
    for (uint32_t row = 0; row < sets->cells; row++) {
        const viewcell_cell *c = sets->cell + row;
        int held = z >= c->bottom && z <= c->top;
        for (int k = 0; held && k < 4; k++) {
            const double *a = c->plan[k], *b = c->plan[(k + 1) % 4];
            held = (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]) >= 0;
        }
        if (held) return row;
    }
    return -1;
}

/* Whether an object may be visible from the view cell in a row; objects that the bake does not know may. */
static int viewcell_potential(const viewcell_sets *sets, int64_t row, uint32_t object) {
    return row < 0 || object >= sets->objects || (sets->bits[(uint64_t)row * sets->stride + object / 8] >> object % 8 & 1);
}
#endif
