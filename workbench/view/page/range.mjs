// Cells that an eye may reach on a way of some length, as solvers/walk/range_cells.py finds them: every length is a lower
// bound, so no cell can be reached on a shorter way (Funkhouser et al. 1996, section 4.3.1).

// Between portals of a cell with more of them any way counts as none, which is a lower bound, too.
const PORTALS_MOST = 200;

/** Least distance between closed boxes, or of a point and a box: 6 numbers each. */
export function apart(a, b) {
  return Math.hypot(...[0, 1, 2].map((k) => Math.max(0, a[k] - b[k + 3], b[k] - a[k + 3])));
}

/** Cells and least lengths of ways to them [m], pairs ascending by length, from an eye in some cells. */
export function rangeCells(maze, eye, holders, reach) {
  const here = [...eye, ...eye];
  const length = new Map(holders.map((cell) => [cell, 0]));
  if (maze.axes.length && holders.length) throughPortals(maze, here, holders, reach, length);
  else {
    for (let cell = 0; cell < maze.count; cell++) {
      const way = apart(maze.boxes.subarray(6 * cell, 6 * cell + 6), here);
      if (way <= reach && !length.has(cell)) length.set(cell, way);
    }
  }
  return [...length].sort((a, b) => a[1] - b[1] || a[0] - b[0]);
}

function throughPortals(maze, here, holders, reach, length) {
  const box = (portal) => maze.portalBox(portal);
  const found = new Map();
  const queue = new Queue();
  const offer = (portal, way) => {
    if (way > reach || found.get(portal) <= way) return;
    found.set(portal, way);
    queue.push(way, portal);
  };
  const crossed = new Set();
  for (const cell of holders) for (const portal of maze.portals[cell]) offer(portal, apart(box(portal), here));
  while (queue.size) {
    const [way, portal] = queue.pop();
    if (way > found.get(portal)) continue;
    for (const side of [0, 1]) {
      const cell = maze.sides[2 * portal + side];
      if (!(length.get(cell) <= way)) length.set(cell, way);
      const own = maze.portals[cell];
      if (own.length > PORTALS_MOST) {
        if (crossed.has(cell)) continue;
        crossed.add(cell);
        for (const other of own) offer(other, way);
      } else for (const other of own) if (other !== portal) offer(other, way + apart(box(portal), box(other)));
    }
  }
}

/** Numbers by a key, the least first. */
class Queue {
  constructor() {
    this.heap = [];
  }

  get size() {
    return this.heap.length;
  }

  push(key, value) {
    const { heap } = this;
    let at = heap.push([key, value]) - 1;
    while (at && heap[(at - 1) >> 1][0] > key) {
      heap[at] = heap[(at - 1) >> 1];
      at = (at - 1) >> 1;
    }
    heap[at] = [key, value];
  }

  pop() {
    const { heap } = this;
    const [top, last] = [heap[0], heap.pop()];
    if (!heap.length) return top;
    let at = 0;
    for (;;) {
      let child = 2 * at + 1;
      if (child >= heap.length) break;
      if (child + 1 < heap.length && heap[child + 1][0] < heap[child][0]) child++;
      if (heap[child][0] >= last[0]) break;
      heap[at] = heap[child];
      at = child;
    }
    heap[at] = last;
    return top;
  }
}
