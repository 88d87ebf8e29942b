/* Outlines of rooms, and where things lie in them. Points are `[x, y]`, y down. */
const Plan = (() => {
  "use strict";
  const extent = (points) => {
    const xs = points.map((p) => p[0]), ys = points.map((p) => p[1]);
    return { left: Math.min(...xs), right: Math.max(...xs), top: Math.min(...ys), bottom: Math.max(...ys) };
  };
  const area = (points) => { const e = extent(points); return (e.right - e.left) * (e.bottom - e.top); };
  const middle = (points) => { const e = extent(points); return [(e.left + e.right) / 2, (e.top + e.bottom) / 2]; };
  /* Whether a point is in an outline: a line from it to the right crosses the outline an odd number of times. */
  const inside = ([x, y], points) => points.filter((a, i) => {
    const b = points[(i + 1) % points.length];
    return (a[1] > y) !== (b[1] > y) && x < a[0] + (b[0] - a[0]) * (y - a[1]) / (b[1] - a[1]);
  }).length % 2 === 1;

  /* Whether an outline lies under a box, at its corners or in its middle. */
  const isUnder = (points, { left, right, top, bottom }) =>
    [left, (left + right) / 2, right].some((x) => [top, bottom].some((y) => inside([x, y], points)))
      || points.some(([x, y]) => x > left && x < right && y > top && y < bottom);

  /* Where an object is drawn that is at a place in metres, y up; null where nobody knows.

     `corner` is where the first corner of its room is, in the same metres. */
  function place(at, corner, outline) {
    if (!at || !corner) return null;
    const spot = [outline[0][0] + at[0] - corner[0], outline[0][1] - at[1] + corner[1]];
    return inside(spot, outline) ? spot : null;
  }

  /* At least `count` points in an outline where `isFree` says so, if there is space; in rows, from the top. */
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
  return { area, extent, inside, isUnder, middle, place, spots };
})();
