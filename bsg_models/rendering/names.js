/* Where names stand in a picture, in pixels: no name covers another. A name that finds no room is left out. */
const Names = (() => {
  "use strict";
  const SIZE = 11.5, ABOVE = 12, BELOW = 4, LINE = 15;  // of the type, and of a line around its baseline
  const FEWEST = 4;  // letters that are left of a name that is cut
  const brush = document.createElement("canvas").getContext("2d");

  const widths = new Map();  // measuring is slow, and a name is tried in many places
  function width(text, weight) {
    const family = getComputedStyle(document.body).fontFamily, key = [family, weight, text].join("\n");
    if (widths.has(key)) return widths.get(key);
    brush.font = `${weight} ${SIZE}px ${family}`;
    widths.set(key, brush.measureText(text).width);
    return widths.get(key);
  }
  /* What is written: a name with its number behind it, or `under` it. */
  const beside = (name, number) => ({ name, number, under: false, wide: width(name, 600) + (number ? 5 + width(number, 400) : 0) + 4 });
  const under = (name, number) => ({ name, number, under: true, wide: Math.max(width(name, 600), width(number, 400)) + 4 });
  const bare = (name) => beside(name, "");
  const boxOf = ({ x, y, wide, under }) =>
    ({ left: x - wide / 2, right: x + wide / 2, top: y - ABOVE, bottom: y + BELOW + (under ? LINE : 0) });
  const meet = (a, b) => a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;
  const within = (a, b) => a.left >= b.left && a.right <= b.right && a.top >= b.top && a.bottom <= b.bottom;

  /* Give each of `wanted`, in order, the first of its places that is free; `taken` boxes are kept clear.

     Returns for each its place `{ name, number, under, x, y, box, leader }`, or null. */
  function settle(wanted, taken, bounds) {
    const boxes = [...taken];
    return wanted.map((places) => {
      for (const place of places) {
        const box = boxOf(place);
        if (!within(box, bounds) || boxes.some((other) => meet(box, other))) continue;
        boxes.push(box);
        return { ...place, box };
      }
      return null;
    });
  }

  /* "dining room" → "dinin…", and "dining room 12" → "dini… 12": what tells two rooms apart stays. */
  function cut(name, letters) {
    if (name.length <= letters) return name;
    const tail = (/ [0-9]{1,3}$/.exec(name) || [""])[0], left = letters - tail.length;
    return left > 1 ? name.slice(0, left - 1).trimEnd() + "…" + tail : name.slice(0, letters - 1) + "…";
  }

  /* Places in an outline: whole with its number, a little cut; then beside it; then cut short; then without its number.

     What lies over the outline, and the planned way's trail, boxes, are kept clear where that can be. */
  function* inOutline(points, name, number, { over, trail, grounds }) {
    const clearOf = (boxes) => (box) => !boxes.some((other) => meet(box, other));
    const cuts = [];
    for (let letters = name.length - 1; letters >= FEWEST; letters--) cuts.push(cut(name, letters));
    const little = cuts.filter((text) => text.length >= 0.6 * name.length), short = cuts.slice(little.length);
    const texts = [beside(name, number), under(name, number), ...little.map((text) => under(text, number))];
    for (const boxes of [[...over, ...trail], trail]) yield* only(clearOf(boxes), inRows(points, texts));
    yield* around(Plan.middle(points), texts.slice(0, 2), clearOf([...grounds, ...trail]));
    yield* inRows(points, [...texts, ...short.map((text) => under(text, number)), beside("", number), bare(name), ...little.map(bare)]);
    yield* around(Plan.middle(points), [bare(name)], clearOf(grounds));
    yield* inRows(points, short.map(bare));
  }

  function* only(isClear, places) { for (const place of places) if (isClear(boxOf(place))) yield place; }

  function* inRows(points, texts) {
    const e = Plan.extent(points);
    for (const text of texts) {
      const { wide } = text, more = text.under ? LINE : 0;
      if (wide > e.right - e.left) continue;
      for (let y = e.top + ABOVE + 2; y < e.bottom - BELOW - more; y += LINE) {
        const [first, last] = [chord(points, y - ABOVE / 2), chord(points, y - ABOVE / 2 + more)];
        const left = Math.max(first[0], last[0]), right = Math.min(first[1], last[1]);
        for (const x of [(left + right) / 2, left + wide / 2 + 2, right - wide / 2 - 2])
          if (right - left >= wide + 2) yield { ...text, x, y, leader: null };
      }
    }
  }
  /* What of a line across lies in an outline. */
  function chord(points, y) {
    const xs = points.flatMap((a, i) => {
      const b = points[(i + 1) % points.length];
      return (a[1] - y) * (b[1] - y) <= 0 && a[1] !== b[1] ? [a[0] + (b[0] - a[0]) * (y - a[1]) / (b[1] - a[1])] : [];
    });
    return [Math.min(...xs), Math.max(...xs)];
  }

  /* Places at a knot where it is clear: above, beside or below it, then cut, then farther off; then where it is not clear;
     then without the number. */
  function* atKnot(knot, name, number, isClear) {
    const full = [beside(name, number), under(name, number)], short = [12, 7].map((letters) => cut(name, letters));
    const texts = [...full, ...short.map((text) => under(text, number))], bares = [name, ...short].map(bare);
    yield* only(isClear, close(knot, texts));
    yield* around(knot, full, isClear);
    yield* close(knot, texts);
    yield* close(knot, bares);
    yield* around(knot, [bare(name)], () => true);
  }
  function* close([x, y], texts) {
    for (const text of texts) {
      const aside = text.wide / 2 + 9, up = text.under ? LINE : 0;
      for (const [dx, dy] of [[0, -12 - up], [aside, 4 - up / 2], [-aside, 4 - up / 2], [0, 20], [aside, -9 - up], [-aside, -9 - up]])
        yield { ...text, x: x + dx, y: y + dy, leader: null };
    }
  }
  /* Clear places farther off, tied to their own by a line. */
  function* around([x, y], texts, isClear) {
    for (const text of texts) {
      for (let far = 26; far <= 150; far += 12) for (let turn = 0; turn < 16; turn++) {
        const angle = -Math.PI / 2 + (turn % 2 ? 1 : -1) * Math.ceil(turn / 2) * Math.PI / 8;
        const at = { x: x + 1.4 * far * Math.cos(angle), y: y + 4 + far * Math.sin(angle) };
        const place = { ...text, ...at, leader: [x, y] };
        if (isClear(boxOf(place))) yield place;
      }
    }
  }
  /* The place at a point: its middle. */
  function* at([x, y], name) { yield { ...bare(name), x, y, leader: null }; }
  /* The place to the right of a point, at its height. */
  function* rightOf([x, y], name) {
    const text = bare(name);
    yield { ...text, x: x + text.wide / 2, y, leader: null };
  }
  /* Places close to a ring of 13 pixels around a point. */
  function* near([x, y], name) {
    const text = bare(name), aside = text.wide / 2 + 14;
    for (const [dx, dy] of [[0, 26], [0, -18], [aside, 4], [-aside, 4]]) yield { ...text, x: x + dx, y: y + dy, leader: null };
  }
  const long = (name) => bare(name).wide;
  return { LINE, settle, inOutline, atKnot, at, near, rightOf, cut, long, meet };
})();
