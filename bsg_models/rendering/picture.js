/* The picture of a belief graph: its layers as the paper draws them, or its plan from above. */
const Picture = (() => {
  "use strict";
  const { draw } = Elements;
  const MOST_NAMES = 80;  // of rooms: more cannot be told apart, and take long to place
  const MOST_STOPS = 10;  // of the planned way
  const MARGIN = { side: 30, top: 36, bottom: 30 };

  /* Draw a view; `look` is `{ plan, sought, node, threshold }`. */
  function show(svg, view, look) {
    svg.replaceChildren();
    const box = svg.getBoundingClientRect(), size = { wide: Math.max(300, box.width), high: Math.max(260, box.height) };
    if (!view.rooms.length) look = { ...look, plan: true };  // nothing has layers
    const scene = { view, look, ...lay(view, look, size) };
    scene.of = view.rooms.map((_, i) => Beliefs.numbers(view, i + 1, look.sought));
    scene.most = Beliefs.mostWorth(view, look.sought);
    const [ties, grounds, doors, ways, things, words, stops] = Array.from({ length: 7 }, () => draw("g", {}, svg));
    scene.bounds = { left: 2, top: 2, right: size.wide - 2, bottom: size.high - 2 };
    scene.here = view.answer && view.answer.here;
    scene.stops = look.sought < Beliefs.ALL ? view.answer.plan.slice(0, MOST_STOPS).filter(({ room }) => room !== Beliefs.NOWHERE) : [];
    scene.line = [scene.here, ...scene.stops.map(({ room }) => room)].filter(Boolean).map((room) => spotOf(scene, room));
    scene.kept = scene.line.map(([x, y]) => square(x, y, 13));
    scene.loose = layLoose(scene);
    const names = nameRooms(scene);
    drawLoose(scene, things);
    if (!view.rooms.length) draw("text", { class: "name", x: size.wide / 2, y: 60 }, svg, "no rooms are known");
    drawDoors(scene, look.plan ? doors : ties);
    drawWay(scene, ways, stops);
    if (!look.plan) drawTies(scene, ties);
    for (const i of scene.order) {
      drawRoom(scene, i, grounds);
      drawThings(scene, i, things, words, names);
      if (!look.plan) drawKnot(scene, i, things);
    }
    if (!look.plan && view.rooms.length) drawBuilding(scene, things);
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
  function nameRooms(scene) {
    const { view, look, of, order, shapes, knots, peak, storeys, bounds, loose, kept, here } = scene;
    const worth = (i) => Beliefs.worth(of[i], look.sought);
    const ranked = view.rooms.map((_, i) => i).sort((a, b) => (b + 1 === look.node) - (a + 1 === look.node) || worth(b) - worth(a) || a - b);
    const boxes = shapes.map(Plan.extent), trail = boxesAlong(scene.line);
    const numberOf = (i) => Beliefs.sayWorth(of[i], look.sought);
    const placesOf = (i) => {
      const name = Names.cut(view.rooms[i].name, 40);
      if (!look.plan) return Names.atKnot(knots[i], name, numberOf(i), (box) =>
        !shapes.some((shape, k) => k !== i && Names.meet(box, boxes[k]) && Plan.isUnder(shape, box)));
      const over = order.slice(order.indexOf(i) + 1).map((k) => boxes[k]);
      return Names.inOutline(shapes[i], name, numberOf(i), { over, trail, grounds: boxes });
    };
    const captions = loose.words ? [...storeys, [loose.words, loose.spot]] : storeys;
    const wanted = captions.map(([text, spot]) => ({ kind: "storey", places: Names.rightOf(spot, text) }));
    if (!look.plan) wanted.push({ kind: "name", places: Names.atKnot([peak[0], peak[1] - 6], Names.cut(view.title, 40), "", () => true) });
    for (const i of ranked.slice(0, MOST_NAMES)) wanted.push({ kind: "name", places: placesOf(i), room: i });
    if (here) wanted.push({ kind: "name", places: Names.near(spotOf(scene, here), "robot") });
    const taken = [...kept, ...loose.dots.map(([, [x, y]]) => square(x, y, 8)), ...(look.plan ? [] : [...knots, peak].map(([x, y]) => square(x, y, 7)))];
    const found = Names.settle(wanted.map((one) => one.places), taken, bounds);
    return dropSmaller(found.map((name, k) => name && { ...wanted[k], ...name }).filter(Boolean), ranked, worth);
  }
  /* Where a room's number found no place, no smaller one may seem to be the greatest. */
  function dropSmaller(names, ranked, worth) {
    const told = new Set(names.map((name) => name.number && name.room));
    const least = Math.max(-1, ...ranked.filter((i) => !told.has(i)).map(worth));
    return names.map((name) => name.room !== undefined && worth(name.room) < least ? { ...name, number: "" } : name)
      .filter((name) => name.name || name.number);
  }
  /* Boxes along a line through some points. */
  const boxesAlong = (line) => line.slice(1).flatMap(([x, y], k) => {
    const [left, top] = line[k], count = Math.ceil(Math.hypot(x - left, y - top) / 8);
    return Array.from({ length: count }, (_, i) => square(left + (x - left) * i / count, top + (y - top) * i / count, 3));
  });
  /* Where the middle of a room's floor is. */
  const spotOf = ({ at, centres }, room) => at(centres[room - 1]);
  const square = (x, y, half) => ({ left: x - half, right: x + half, top: y - half, bottom: y + half });

  function drawName({ name, number, under, x, y, leader, box, kind }, words) {
    if (leader) draw("line", { class: "leader", x1: leader[0], y1: leader[1],
      x2: Math.max(box.left, Math.min(box.right, leader[0])), y2: Math.max(box.top, Math.min(box.bottom, leader[1])) }, words);
    const text = draw("text", { class: kind, x, y }, words, name);
    if (number) draw("tspan", { class: "number", ...(under ? { x, dy: Names.LINE } : { dx: name ? 5 : 0 }) }, text, number);
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

  /* What was seen in a room, or in none, 0, and its blind nodes. */
  function thingsIn({ view, look }, room) {
    const isShown = (thing) => thing.room === room && Beliefs.isSought(look.sought, thing);
    const seen = view.objects.filter(isShown).sort((a, b) => (a.class === null) - (b.class === null));
    return [...seen, ...view.blind.filter((node) => isShown(node) && node.presence >= look.threshold)];
  }
  const drawDot = ({ view, look, radius }, thing, [cx, cy], parent) =>
    draw("circle", { cx, cy, r: radius, "data-node": thing.room, ...dot(view, look, thing) }, parent);

  /* Lay what is in no room into a row beside the building, as many as there is space for. */
  function layLoose(scene) {
    const { look, peak, bounds } = scene, all = thingsIn(scene, 0);
    const radius = Math.max(3.5, scene.radius), step = 2 * radius + 3;
    const spot = look.plan ? [10, bounds.bottom - 8] : [peak[0] + 24, peak[1] + 4];
    const words = all.length ? `${all.length} in no room` : "";
    const left = spot[0] + Names.long(words) + 8, y = spot[1] - 4;
    const shown = all.slice(0, Math.max(1, Math.floor((bounds.right - left) / step)));
    return { radius, words, spot, dots: shown.map((thing, k) => [thing, [left + k * step, y]]) };
  }
  function drawLoose(scene, things) {
    const { dots, radius } = scene.loose;
    for (const [thing, spot] of dots) drawDot({ ...scene, radius }, thing, spot, things);
  }

  /* Find the rooms on the shortest way through connections, without the first; straight on if there is none. */
  function route(scene, from, to) {
    const far = new Map([[from, 0]]), before = new Map(), open = new Set([from]);
    while (open.size) {
      const room = [...open].reduce((a, b) => (far.get(b) < far.get(a) ? b : a));
      if (room === to) break;
      open.delete(room);
      for (const pair of scene.view.adjacency) if (pair.includes(room)) {
        const next = pair[0] === room ? pair[1] : pair[0], [x, y] = spotOf(scene, room), [u, v] = spotOf(scene, next);
        const length = far.get(room) + Math.hypot(x - u, y - v);
        if (length < (far.has(next) ? far.get(next) : Infinity)) { far.set(next, length); before.set(next, room); open.add(next); }
      }
    }
    const rooms = [to];
    while (before.has(rooms[0]) && before.get(rooms[0]) !== from) rooms.unshift(before.get(rooms[0]));
    return rooms;
  }
  /* Draw where the robot is, and from there the planned way through the rooms, numbered. */
  function drawWay(scene, ways, stops) {
    const { view, here } = scene;
    const rooms = [here, ...scene.stops.map(({ room }) => room)].filter(Boolean);
    const legs = rooms.slice(1).map((room, k) => route(scene, rooms[k], room));
    const line = [rooms.slice(0, 1), ...legs].flat().map((room) => spotOf(scene, room));
    for (const [name, points] of [["edge", line], ["later", line], ["", here && legs.length ? line.slice(0, legs[0].length + 1) : []]])
      draw("polyline", { class: "way " + name, points: points.map((p) => p.join(",")).join(" ") }, ways);
    if (here) {
      const [cx, cy] = spotOf(scene, here), said = "the robot is in " + Beliefs.nodeName(view, here);
      for (const r of [12, 3]) draw("circle", { class: "robot", cx, cy, r, "data-node": here, "data-say": said }, stops);
    }
    const first = (stop, k, all) => all.findIndex(({ room }) => room === stop.room) === k;  // of the looks into a room
    for (const { step, room } of scene.stops.filter(first)) {
      const [x, y] = spotOf(scene, room), said = `${step}: ${Beliefs.nodeName(view, room)}`;
      const mark = draw("g", { class: "stop", "data-node": room, "data-say": said }, stops);
      draw("circle", { cx: x, cy: y, r: 8.5 }, mark);
      draw("text", { x, y: y + 4 }, mark, step);
    }
  }

  /* Draw what was seen in a room and its blind nodes: where they are, or else where the room has space. */
  function drawThings(scene, i, things, words, names) {
    const { view, look, outlines, at, centres, scale, radius } = scene;
    const all = thingsIn(scene, i + 1), count = all.length, taken = [...scene.kept, ...names.map((name) => name.box)];
    const spots = Plan.spots(outlines[i], count, freeSpots(scene, i, taken));
    const named = look.node === i + 1 && Math.sqrt(Plan.area(outlines[i]) / (1.7 * count + 5)) * scale > 46;
    const labels = [];
    for (const thing of all) {
      const spot = Plan.place(thing.at, view.rooms[i].corner, outlines[i]) || spots.splice(Math.floor(spots.length * 0.382), 1)[0] || centres[i];
      const [x, y] = at(spot);
      drawDot(scene, thing, [x, y], things);
      const name = thing.class === null ? thing.name : view.classes[thing.class];
      if (named) labels.push(Names.at([x, y + radius + 10], Names.cut(name, 14)));
    }
    for (const label of Names.settle(labels, taken, scene.bounds))
      if (label) drawName({ ...label, kind: "thing" }, words);
  }
  /* Whether a spot is clear of what is taken, boxes, and of smaller rooms that lie over this one. */
  function freeSpots({ order, outlines, at, radius }, i, taken) {
    const over = order.slice(order.indexOf(i) + 1).map((k) => outlines[k]);
    return (spot) => {
      const [x, y] = at(spot);
      return !over.some((outline) => Plan.inside(spot, outline)) && !taken.some((box) =>
        x > box.left - radius && x < box.right + radius && y > box.top - radius && y < box.bottom + radius);
    };
  }
  function dot(view, look, thing) {
    if (thing.presence !== undefined) return { class: "blind", "fill-opacity": (0.2 + 0.8 * thing.presence).toFixed(2),
      "data-say": "blind node, " + Beliefs.say(view, thing.room, thing.class) };
    const kind = look.sought !== Beliefs.ALL ? " sought" : thing.class === null ? " classless" : "";
    return { class: "object" + kind, "data-say": (thing.name || "an object") + ", seen" + (thing.class === null ? ", belongs to no class" : "") };
  }
  return { show };
})();
