/* The picture of a belief graph: its layers as the paper draws them, or its plan from above. */
const Picture = (() => {
  "use strict";
  const { draw } = Elements;
  const MOST_NAMES = 80;  // of rooms: more cannot be told apart, and take long to place
  const MARGIN = { side: 30, top: 36, bottom: 30 };

  /* Draw a view; `look` is `{ plan, sought, node, threshold }`. */
  function show(svg, view, look) {
    svg.replaceChildren();
    const box = svg.getBoundingClientRect(), size = { wide: Math.max(300, box.width), high: Math.max(260, box.height) };
    if (!view.rooms.length) {
      draw("text", { class: "name", x: size.wide / 2, y: 60 }, svg, "no rooms are known");
      return;
    }
    const scene = { view, look, ...lay(view, look, size) };
    scene.of = view.rooms.map((_, i) => Beliefs.numbers(view, i + 1, look.sought));
    scene.most = Beliefs.mostWorth(view, look.sought);
    const [ties, grounds, doors, things, words] = Array.from({ length: 5 }, () => draw("g", {}, svg));
    scene.bounds = { left: 2, top: 2, right: size.wide - 2, bottom: size.high - 2 };
    const names = nameRooms(scene);
    drawDoors(scene, look.plan ? doors : ties);
    if (!look.plan) drawTies(scene, ties);
    for (const i of scene.order) {
      drawRoom(scene, i, grounds);
      drawThings(scene, i, things, words, names);
      if (!look.plan) drawKnot(scene, i, things);
    }
    if (!look.plan) drawBuilding(scene, things);
    for (const name of names) drawName(name, words);
  }

  /* Fit the rooms into the picture: `at` is where a point of the plan, at a height, is in pixels. */
  function lay(view, look, size) {
    const wide = size.wide - 2 * MARGIN.side, high = size.high - MARGIN.top - MARGIN.bottom;
    const { rooms, captions } = look.plan ? view.plan : view.row;
    const outlines = [];
    for (const { number, outline } of rooms) outlines[number - 1] = outline;
    const flat = ([x, y], z = 0) => look.plan ? [x, y] : [x + 0.42 * y, 0.52 * y - z];
    const floor = Plan.extent(outlines.flat()), e = Plan.extent(outlines.flat().map((p) => flat(p)));
    const up = look.plan ? 0 : heightOfLayers(floor, e, wide / high);
    const scale = Math.min(wide / Math.max(1, e.right - e.left), high / Math.max(1, e.bottom - e.top + 2.15 * up));
    const dx = (size.wide - scale * (e.left + e.right)) / 2;
    const dy = MARGIN.top + (high - scale * (e.bottom - e.top - 2.15 * up)) / 2 - scale * e.top;
    const at = (p, z) => { const [x, y] = flat(p, z); return [dx + scale * x, dy + scale * y]; };
    const centres = outlines.map(Plan.middle);
    const peak = [0, 1].map((k) => Beliefs.sum(centres.map((p) => p[k])) / centres.length);
    return { outlines, at, scale, centres, shapes: outlines.map((outline) => outline.map((p) => at(p))),
      order: rooms.map((room) => room.number - 1),  // small rooms lie over large ones
      parts: rooms.reduce((parts, { number, part }) => { parts[number - 1] = part; return parts; }, []),
      storeys: captions.map(([text, spot]) => [text, at(spot)]),
      knots: centres.map((p) => at(p, up)), peak: at(peak, 2 * up),
      radius: Math.max(2.2, Math.min(5.2, scale * 0.075)) };
  }
  /* The rooms stand as high above their floors as the picture has room for. */
  function heightOfLayers(floor, flat, ratio) {
    const wide = floor.right - floor.left, deep = floor.bottom - floor.top;
    const free = (flat.right - flat.left) / ratio - (flat.bottom - flat.top);
    return Math.max(2.2, 0.28 * Math.max(deep, wide * 0.55), Math.min(0.6 * deep + 1, free / 2.15));
  }

  /* Settle the names of storeys, the building and its rooms: the one that is chosen first, then by worth. */
  function nameRooms({ view, look, of, order, shapes, knots, peak, storeys, bounds }) {
    const ranked = view.rooms.map((_, i) => i).sort((a, b) =>
      (b + 1 === look.node) - (a + 1 === look.node) || Beliefs.worth(of[b], look.sought) - Beliefs.worth(of[a], look.sought) || a - b);
    const boxes = shapes.map(Plan.extent);
    const numberOf = (i) => Beliefs.sayWorth(of[i], look.sought);
    const placesOf = (i) => {
      const name = Names.cut(view.rooms[i].name, 40);
      if (!look.plan) return Names.atKnot(knots[i], name, numberOf(i));
      const over = order.slice(order.indexOf(i) + 1).map((k) => boxes[k]);
      return Names.inOutline(shapes[i], name, numberOf(i), { over, grounds: boxes });
    };
    const captions = storeys.map(([text, spot]) => Names.rightOf(spot, text));
    const building = look.plan ? [] : [Names.atKnot([peak[0], peak[1] - 6], Names.cut(view.title, 40), "")];
    const taken = look.plan ? [] : [...knots, peak].map(([x, y]) => square(x, y, 7));
    const found = Names.settle([...captions, ...building, ...ranked.slice(0, MOST_NAMES).map(placesOf)], taken, bounds);
    return found.map((name, k) => name && { ...name, kind: k < captions.length ? "storey" : "name" }).filter(Boolean);
  }
  const square = (x, y, half) => ({ left: x - half, right: x + half, top: y - half, bottom: y + half });

  function drawName({ name, number, x, y, wide, leader, box, kind }, words) {
    if (leader) draw("line", { class: "leader", x1: leader[0], y1: leader[1],
      x2: Math.max(box.left, Math.min(box.right, leader[0])), y2: Math.max(box.top, Math.min(box.bottom, leader[1])) }, words);
    const text = draw("text", { class: kind, x, y }, words, name);
    if (number) draw("tspan", { class: "number", dx: 5 }, text, number);
  }

  const line = (name, [x1, y1], [x2, y2], parent) => draw("line", { class: name, x1, y1, x2, y2 }, parent);

  function drawTies({ knots, peak, shapes }, ties) {
    knots.forEach((knot, i) => {
      line("tie", peak, knot, ties);
      line("tie foot", knot, Plan.middle(shapes[i]), ties);
    });
  }
  function drawDoors({ view, look, knots, shapes, parts }, parent) {
    const end = (room) => look.plan ? Plan.middle(shapes[room - 1]) : knots[room - 1];
    for (const [a, b] of view.adjacency) {
      line(parts[a - 1] !== parts[b - 1] ? "adjacent stairs" : "adjacent", end(a), end(b), parent);
    }
  }

  const kindOf = ({ view, look }, node) => ["room", view.rooms[node - 1].visited ? "" : "unvisited",
    look.node === node ? "chosen" : ""].join(" ");

  function drawRoom(scene, i, grounds) {
    const { view, look, of, most, shapes } = scene;
    const said = Beliefs.say(view, i + 1, look.sought);
    const group = draw("g", { class: kindOf(scene, i + 1), tabindex: 0, role: "button", "data-node": i + 1,
      "aria-label": said, "data-say": said }, grounds);
    const share = Beliefs.worth(of[i], look.sought) / most;
    draw("polygon", { class: "ground", points: shapes[i].map((p) => p.join(",")).join(" "), style: { "--share": share.toFixed(4) } }, group);
  }
  function drawKnot(scene, i, things) {
    const [x, y] = scene.knots[i], said = Beliefs.say(scene.view, i + 1, scene.look.sought);
    const group = draw("g", { class: kindOf(scene, i + 1), "data-node": i + 1, "data-say": said }, things);
    draw("rect", { class: "knot", x: x - 6.5, y: y - 6.5, width: 13, height: 13 }, group);
  }
  function drawBuilding({ view, look, peak: [x, y] }, things) {
    const said = Beliefs.say(view, 0, look.sought);
    const group = draw("g", { class: "room building", tabindex: 0, role: "button", "data-node": 0, "aria-label": said, "data-say": said }, things);
    draw("ellipse", { cx: x, cy: y + 7, rx: 15, ry: 5 }, group);
    draw("rect", { x: x - 15, y: y - 8, width: 30, height: 15 }, group);
    draw("ellipse", { class: "lid", cx: x, cy: y - 8, rx: 15, ry: 5 }, group);
  }

  /* Draw what was seen in a room and its blind nodes: where they are, or else where the room has space. */
  function drawThings(scene, i, things, words, names) {
    const { view, look, outlines, at, centres, scale, radius } = scene;
    const seen = view.objects.filter((obj) => obj.room === i + 1 && Beliefs.isSought(look.sought, obj.class));
    seen.sort((a, b) => (a.class === null) - (b.class === null));
    const blind = view.blind.filter((node) => node.room === i + 1 && node.presence >= look.threshold && Beliefs.isSought(look.sought, node.class));
    const count = seen.length + blind.length;
    const spots = Plan.spots(outlines[i], count, freeSpots(scene, i, names));
    const named = look.node === i + 1 && Math.sqrt(Plan.area(outlines[i]) / (1.7 * count + 5)) * scale > 46;
    const labels = [];
    for (const thing of [...seen, ...blind]) {
      const spot = Plan.place(thing.at, view.rooms[i].corner, outlines[i]) || spots.splice(Math.floor(spots.length * 0.382), 1)[0] || centres[i];
      const [x, y] = at(spot);
      draw("circle", { cx: x, cy: y, r: radius, "data-node": i + 1, ...dot(view, look, thing) }, things);
      const name = thing.class === null ? thing.name : view.classes[thing.class];
      if (named) labels.push(Names.under([x, y + radius + 10], Names.cut(name, 14)));
    }
    for (const label of Names.settle(labels, names.map((name) => name.box), scene.bounds))
      if (label) drawName({ ...label, kind: "thing" }, words);
  }
  /* Whether a spot is clear of the names, and of smaller rooms that lie over this one. */
  function freeSpots({ order, outlines, at, radius }, i, names) {
    const over = order.slice(order.indexOf(i) + 1).map((k) => outlines[k]);
    return (spot) => {
      const [x, y] = at(spot);
      return !over.some((outline) => Plan.inside(spot, outline)) && !names.some(({ box }) =>
        x > box.left - radius && x < box.right + radius && y > box.top - radius && y < box.bottom + radius);
    };
  }
  function dot(view, look, thing) {
    if (thing.presence !== undefined) return { class: "blind", "fill-opacity": (0.2 + 0.8 * thing.presence).toFixed(2),
      "data-say": "blind node, " + Beliefs.say(view, thing.room, thing.class) };
    const kind = thing.class === null ? " classless" : look.sought === Beliefs.ALL ? "" : " sought";
    return { class: "object" + kind, "data-say": (thing.name || "an object") + ", seen" + (thing.class === null ? ", belongs to no class" : "") };
  }
  return { show };
})();
