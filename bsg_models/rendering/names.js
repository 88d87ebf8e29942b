/* Where names stand in a picture, in pixels: no name covers another. A name that finds no room is left out. */
const Names = (() => {
  "use strict";
  const SIZE = 11.5, ABOVE = 12, BELOW = 4, LINE = 15;  // of the type, and of a line around its baseline
  const FEWEST = 4;  // letters that are left of a name that is cut
  const brush = document.createElement("canvas").getContext("2d");

  const widths = new Map();  // measuring is slow, and a name is tried in many places
  function width(name, number) {
    const family = getComputedStyle(document.body).fontFamily, key = [family, name, number].join("\n");
    if (widths.has(key)) return widths.get(key);
    const measure = (text, weight) => { brush.font = `${weight} ${SIZE}px ${family}`; return brush.measureText(text).width; };
    widths.set(key, measure(name, 600) + (number ? 5 + measure(number, 400) : 0) + 4);
    return widths.get(key);
  }
  const boxOf = ({ x, y, wide }) => ({ left: x - wide / 2, right: x + wide / 2, top: y - ABOVE, bottom: y + BELOW });
  const meet = (a, b) => a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;
  const within = (a, b) => a.left >= b.left && a.right <= b.right && a.top >= b.top && a.bottom <= b.bottom;

  /* Give each of `wanted`, in order, the first of its places that is free; `taken` boxes are kept clear.

     Returns for each its place `{ name, number, x, y, box, leader }`, or null. */
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

  /* Places in an outline: whole with its number, whole, a little cut; then beside it; then cut short.

     What lies over the outline, boxes, is kept clear where that can be. */
  function* inOutline(points, name, number, { over, grounds }) {
    const cuts = [];
    for (let letters = name.length - 1; letters >= FEWEST; letters--) cuts.push([cut(name, letters), ""]);
    const little = cuts.filter(([text]) => text.length >= 0.6 * name.length);
    const texts = [[name, number], [name, ""], ...little];
    for (const place of inRows(points, texts)) {
      const own = boxOf(place);
      if (!over.some((box) => meet(own, box))) yield place;
    }
    yield* inRows(points, texts);
    yield* around(Plan.middle(points), [[name, number], [name, ""]], grounds);
    yield* inRows(points, cuts.slice(little.length));
  }

  function* inRows(points, texts) {
    const e = Plan.extent(points);
    for (const [name, number] of texts) {
      const wide = width(name, number);
      if (wide > e.right - e.left) continue;
      for (let y = e.top + ABOVE + 2; y < e.bottom - BELOW; y += LINE) {
        const [left, right] = chord(points, y - ABOVE / 2);
        for (const x of [(left + right) / 2, left + wide / 2 + 2, right - wide / 2 - 2])
          if (right - left >= wide + 2) yield { name, number, x, y, wide, leader: null };
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

  /* Places at a knot: above, beside or below it, then farther off, then cut. */
  function* atKnot([x, y], name, number) {
    for (const [text, extra] of [[name, number], [name, ""], [cut(name, 12), ""], [cut(name, 7), ""]]) {
      const wide = width(text, extra), aside = wide / 2 + 9;
      for (const [dx, dy] of [[0, -12], [aside, 4], [-aside, 4], [0, 20], [aside, -9], [-aside, -9]])
        yield { name: text, number: extra, x: x + dx, y: y + dy, wide, leader: null };
    }
    yield* around([x, y], [[name, ""]], []);
  }
  /* Places off the grounds of rooms, tied to their own by a line. */
  function* around([x, y], texts, grounds) {
    for (const [name, number] of texts) {
      const wide = width(name, number);
      for (let far = 26; far <= 150; far += 12) for (let turn = 0; turn < 16; turn++) {
        const angle = -Math.PI / 2 + (turn % 2 ? 1 : -1) * Math.ceil(turn / 2) * Math.PI / 8;
        const at = { x: x + 1.4 * far * Math.cos(angle), y: y + 4 + far * Math.sin(angle) };
        const place = { name, number, ...at, wide, leader: [x, y] };
        const box = boxOf(place);
        if (!grounds.some((ground) => meet(box, ground))) yield place;
      }
    }
  }
  /* The place right under a dot. */
  function* under([x, y], name) { yield { name, number: "", x, y, wide: width(name, ""), leader: null }; }
  /* The place to the right of a point, at its height. */
  function* rightOf([x, y], name) {
    const wide = width(name, "");
    yield { name, number: "", x: x + wide / 2, y, wide, leader: null };
  }
  return { settle, inOutline, atKnot, under, rightOf, cut };
})();
