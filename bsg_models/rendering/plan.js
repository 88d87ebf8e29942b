/* Where rooms lie, in metres: x to the right, y down.

   Rooms lie where their outlines are, each storey for itself; rooms without a place in a grid. */
const Plan = (() => {
  "use strict";
  const GAP = 2.2;  // between storeys
  const SIDE = 2.8, PITCH = 3.3;  // of a square in the grid

  const extent = (points) => {
    const xs = points.map((p) => p[0]), ys = points.map((p) => p[1]);
    return { left: Math.min(...xs), right: Math.max(...xs), top: Math.min(...ys), bottom: Math.max(...ys) };
  };
  const area = (points) => { const e = extent(points); return (e.right - e.left) * (e.bottom - e.top); };
  const middle = (points) => { const e = extent(points); return [(e.left + e.right) / 2, (e.top + e.bottom) / 2]; };
  /* Whether a point is in a convex outline, whichever way round that is. */
  function inside([x, y], points) {
    const side = points.map((a, i) => {
      const b = points[(i + 1) % points.length];
      return (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]);
    });
    return side.every((s) => s >= 0) || side.every((s) => s <= 0);
  }

  /* Return each room's outline, where an object of a room lies (null where unknown), and the storeys' names. */
  function arrange(view, { ratio, inOneRow }) {
    const cells = storeys(view);
    pack(cells, ratio, inOneRow);
    const outlines = [], cellOf = [];
    for (const cell of cells) cell.rooms.forEach((i, k) => {
      outlines[i] = cell.outlines[k].map(([x, y]) => [x + cell.x, y + cell.y]);
      cellOf[i] = cell;
    });
    const place = (i, at) => {
      if (!at || !view.rooms[i].outline) return null;
      const spot = [at[0] + cellOf[i].x, cellOf[i].y - at[1]];
      return inside(spot, outlines[i]) ? spot : null;
    };
    const names = cells.length > 1 ? cells.map((cell) => ({ text: cell.name, rooms: cell.rooms })) : [];
    return { outlines, place, names };
  }

  function storeys(view) {
    const known = [], stray = [];
    view.rooms.forEach((room, i) => (room.outline ? known : stray).push(i));
    const floors = [...new Set(known.map((i) => view.rooms[i].floor))].sort((a, b) => a - b);
    const cells = floors.map((floor, k) => {
      const rooms = known.filter((i) => view.rooms[i].floor === floor);
      return { name: "storey " + (k + 1), rooms,
        outlines: rooms.map((i) => view.rooms[i].outline.map(([x, y]) => [x, -y])) };
    });
    if (stray.length) cells.push({ name: "place unknown", rooms: stray, outlines: grid(stray.length) });
    return cells;
  }

  function grid(count) {
    const across = Math.max(1, Math.ceil(Math.sqrt(count * 1.7)));
    return Array.from({ length: count }, (_, i) => {
      const x = (i % across) * PITCH, y = Math.floor(i / across) * PITCH;
      return [[x, y], [x + SIDE, y], [x + SIDE, y + SIDE], [x, y + SIDE]];
    });
  }

  /* Lay storeys in rows, as many beside each other as make all of them largest in a picture of this ratio. */
  function pack(cells, ratio, inOneRow) {
    const extents = cells.map((cell) => extent(cell.outlines.flat()));
    const lay = (columns) => {
      const places = [];
      let x = 0, y = 0, deep = 0, wide = 0;
      extents.forEach((e, k) => {
        if (k && k % columns === 0) { x = 0; y += deep + GAP; deep = 0; }
        places.push([x - e.left, y - e.top]);
        x += e.right - e.left + GAP;
        deep = Math.max(deep, e.bottom - e.top);
        wide = Math.max(wide, x - GAP);
      });
      return { places, size: Math.max(wide / ratio, y + deep) };
    };
    const layouts = inOneRow ? [lay(cells.length)] : cells.map((_, k) => lay(k + 1));
    const best = layouts.reduce((a, b) => b.size < a.size ? b : a);
    cells.forEach((cell, k) => { [cell.x, cell.y] = best.places[k]; });
  }

  /* At least `count` points in an outline where `isFree` says so, if there is room; in rows, from the top. */
  function spots(outline, count, isFree) {
    const e = extent(outline);
    let found = [];
    for (let step = Math.sqrt(area(outline) / (1.7 * count + 5)); found.length < count && step > 0.12; step *= 0.85) {
      found = [];
      for (let y = e.top + step * 0.7; y < e.bottom - step * 0.4; y += step)
        for (let x = e.left + step * 0.7; x < e.right - step * 0.4; x += step)
          if (inside([x, y], outline) && isFree([x, y])) found.push([x, y]);
    }
    return found;
  }
  return { arrange, area, extent, inside, middle, spots };
})();
