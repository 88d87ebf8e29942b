/* A search by one robot or by several, step by step: the plan of each, and what it knows in words. */
(() => {
  "use strict";
  const { draw } = Elements, { percent } = Beliefs;
  const STEP_MS = 1200, LETTER = 6.4, LINE = 13;  // pixels
  const replay = JSON.parse(document.getElementById("replay").textContent);
  const { plan, walks } = replay, pick = (name) => document.getElementById(name);
  const panels = [...document.querySelectorAll(".walk")];
  const rooms = new Map(plan.rooms.map((room) => [room.number, room]));
  const last = Math.max(...walks.map((walk) => walk.stops.length)) - 1;
  let step = 0, timer = null;

  /* Draw where a robot is after so many rooms; one that is done stays. */
  function show(panel, stops) {
    const svg = panel.querySelector("svg"), here = stops[stops.length - 1];
    const box = svg.getBoundingClientRect();
    const scale = Math.min((box.width - 8) / Math.max(1, plan.width), (box.height - 8) / Math.max(1, plan.height));
    const [dx, dy] = [(box.width - scale * plan.width) / 2, (box.height - scale * plan.height) / 2];
    const at = ([x, y]) => [dx + scale * x, dy + scale * y];
    const scene = { svg, stops, here, at, centre: (room) => at(Plan.middle(rooms.get(room).outline)) };
    svg.replaceChildren();
    for (const room of plan.rooms) drawRoom(scene, room);  // small rooms lie over large ones
    for (const [text, spot] of plan.captions) draw("text", { class: "caption", x: at(spot)[0], y: at(spot)[1] }, svg, text);
    for (const [a, b] of replay.doors) if (rooms.get(a).part === rooms.get(b).part) drawLine(scene, "door", a, b);
    drawWay(scene);
  }

  function drawRoom({ svg, stops, here, at }, room) {
    const outline = room.outline.map(at), points = outline.map((p) => p.join(",")).join(" "), e = Plan.extent(outline);
    const been = stops.some((stop) => stop.room === room.number);
    const likely = !been && here.presence ? here.presence[room.number - 1] : null;
    const kind = ["room", been ? "entered" : "", replay.holds.includes(room.number) ? "holds" : ""].join(" ");
    const group = draw("g", { class: kind }, svg);
    draw("polygon", { class: "floor", points }, group);
    if (likely !== null) draw("polygon", { class: "likely", points, "fill-opacity": likely }, group);
    draw("polygon", { class: "wall", points }, group);
    draw("title", {}, group, room.name + (likely === null ? "" : ": " + percent(likely)));
    const left = at([room.name_x, 0])[0], name = Names.cut(room.name, Math.floor((e.right - left - 6) / LETTER));
    const words = [...(name.length > 2 || name === room.name ? [name] : []), ...(likely === null ? [] : [percent(likely)])];
    words.slice(0, Math.floor((e.bottom - e.top - 2) / LINE)).forEach((text, k) =>
      draw("text", { class: "name", x: left + 4, y: e.top + LINE * (k + 1) }, group, text));
  }

  function drawLine({ svg, centre }, kind, from, to) {
    const [[x1, y1], [x2, y2]] = [centre(from), centre(to)];
    const stairs = rooms.get(from).part === rooms.get(to).part ? "" : " stairs";
    draw("line", { class: kind + stairs, x1, y1, x2, y2 }, svg);
  }

  function drawWay(scene) {
    const { svg, stops, here, centre } = scene, way = [stops[0].room, ...stops.flatMap((stop) => stop.way)];
    way.slice(1).forEach((room, k) => drawLine(scene, "way", way[k], room));
    if (here.target !== null) {
      drawLine(scene, "next", here.room, here.target);
      draw("circle", { class: "goal", cx: centre(here.target)[0], cy: centre(here.target)[1], r: 5.5 }, svg);
    }
    stops.forEach((stop, k) => {
      const [cx, cy] = centre(stop.room);
      draw("circle", { class: "robot" + (stop.found.length ? " found" : ""), cx, cy, r: stop === here ? 11 : 8.5 }, svg);
      draw("text", { class: "number", x: cx, y: cy + 3.8 }, svg, k);
    });
  }

  const cost = (x) => x.toFixed(1) + (replay.unit ? " " + replay.unit : "");
  function tell(panel, stops) {
    const here = stops[stops.length - 1];
    const entered = stops.length - 1, done = here.target === null, name = (room) => rooms.get(room).name;
    panel.classList.toggle("done", done);
    panel.querySelector(".cost").textContent = cost(here.cost);
    panel.querySelector(".count").textContent =
      "travelled, " + entered + (entered === 1 ? " room" : " rooms") + " entered" + (done ? ", done" : "");
    const seen = here.seen.map(([what, many]) => many + " × " + what).join(", ") || "no object of a class";
    const found = here.found.length ? " Found: " + here.found.join(", ") + "." : "";
    const next = done ? " The search is over." : ` Next: ${name(here.target)}, ${cost(here.leg)} away`
      + (here.presence ? ", " + percent(here.presence[here.target - 1]) + " likely." : ".");
    panel.querySelector(".told").textContent =
      (entered ? "Entered " : "Begins in ") + name(here.room) + ": saw " + seen + "." + found + next;
  }

  function go(to) {
    step = Math.max(0, Math.min(last, to));
    pick("step").value = step;
    pick("where").textContent = "room " + step + " of " + last;
    history.replaceState(null, "", "#" + step);
    const reached = walks.map((walk) => walk.stops.slice(0, step + 1));
    panels.forEach((panel, k) => tell(panel, reached[k]));  // first: the words leave room for the plan
    panels.forEach((panel, k) => show(panel, reached[k]));
  }
  function play(on) {
    clearInterval(timer);
    timer = on ? setInterval(() => step < last ? go(step + 1) : play(false), STEP_MS) : null;
    if (on && step === last) go(0);
    pick("play").textContent = on ? "pause" : "play";
  }
  const jump = (to) => { play(false); go(to); };
  const keys = { ArrowLeft: () => step - 1, ArrowRight: () => step + 1, Home: () => 0, End: () => last };
  pick("play").addEventListener("click", () => play(timer === null));
  pick("back").addEventListener("click", () => jump(step - 1));
  pick("on").addEventListener("click", () => jump(step + 1));
  pick("step").addEventListener("input", (event) => jump(Number(event.target.value)));
  document.addEventListener("keydown", (event) => {
    if (event.key === " " && event.target.tagName !== "BUTTON") play(timer === null);
    else if (keys[event.key] && event.target.id !== "step") jump(keys[event.key]());
    else return;
    event.preventDefault();
  });
  const linked = () => Number(location.hash.slice(1)) || 0;
  window.addEventListener("resize", () => go(step));
  window.addEventListener("hashchange", () => jump(linked()));
  go(linked());
})();
