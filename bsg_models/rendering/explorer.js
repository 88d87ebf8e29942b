/* The page: what is shown, and what pointer, keyboard and link change of it. */
(() => {
  "use strict";
  const { make } = Elements;
  const { views } = JSON.parse(document.getElementById("beliefs").textContent);
  const titles = Link.distinct(views.map((view) => view.title));
  const root = document.querySelector(".bsg"), pick = (name) => document.getElementById(name);
  const svg = root.querySelector("svg.graph"), main = root.querySelector("main"), side = root.querySelector("aside");
  const isCrowded = views.length > 0 && views[0].rooms.length > 20;
  const look = start();

  function start(view = 0) {
    const { answer } = views[view], sought = Beliefs.first(views[view]);
    return { view, node: 0, sought, threshold: 0, plan: innerWidth < 640 || isCrowded || Boolean(answer), theme: "" };
  }

  function change(some) {
    Object.assign(look, some);
    if ("view" in some) fillClasses();
    look.node = Math.min(look.node, views[look.view].rooms.length);
    show();
  }
  function show() {
    showControls();
    paint();
    Panel.show([...side.children], views[look.view], look, turn);
    pick("spoken").textContent = Beliefs.say(views[look.view], look.node, look.sought);
    Link.write(views, titles, look);
  }
  function showControls() {
    pick("view").value = look.view;
    pick("left-out").textContent = views[look.view].left_out;
    pick("left-out").hidden = !views[look.view].left_out;
    pick("class").value = look.sought;
    pick("threshold").value = Math.round(100 * look.threshold);
    pick("shown").textContent = pick("threshold").value + " %";
    pick("plan").setAttribute("aria-pressed", look.plan);
    pick("layers").setAttribute("aria-pressed", !look.plan);
  }
  function paint() {
    pick("caption").hidden = true;
    Panel.explain(root.querySelector(".legend"), views[look.view], look);
    Picture.show(svg, views[look.view], look);
  }

  /* Change what the panel asks for; the keyboard goes on where it was. */
  function turn(some) {
    const before = look.node;
    change(some);
    const again = "node" in some ? (look.node ? ".back" : `.rooms [data-key="${before}"]`) : `.classes [data-key="${look.sought}"]`;
    const found = side.querySelector(again);
    if (found && found.closest("details")) found.closest("details").open = true;
    if (found) found.focus();
  }

  /* Hide blind nodes that are less likely; what is said in words stays. */
  function hide(threshold) {
    look.threshold = threshold;
    showControls();
    paint();
    Link.write(views, titles, look);
  }

  function fillClasses() {
    const view = views[look.view], select = pick("class");
    select.replaceChildren();
    const add = (value, text) => make("option", { value }, select, text);
    Beliefs.things(view).forEach((one, k) => add(Beliefs.askedAs(k), `${one.thing} (asked)`));
    add(Beliefs.ALL, "all classes");
    view.classes.map((name, c) => [name, c]).sort((a, b) => a[0].localeCompare(b[0]))
      .forEach(([name, c]) => add(c, `${name} (${Beliefs.amount(Beliefs.numbers(view, 0, c).more)} more)`));
    if (!Beliefs.has(view, look.sought)) look.sought = Beliefs.first(view);
  }

  /* Tell beside what is pointed at, or focused, what it is. */
  function tell(event) {
    const told = event.target.closest && event.target.closest("[data-say]"), caption = pick("caption");
    caption.hidden = !told;
    if (!told) return;
    caption.textContent = told.dataset.say;
    const at = told.getBoundingClientRect(), frame = main.getBoundingClientRect(), own = caption.getBoundingClientRect();
    const x = event.clientX === undefined ? (at.left + at.right) / 2 : event.clientX;
    const y = event.clientY === undefined ? at.top : event.clientY;
    caption.style.left = Math.max(4, Math.min(frame.width - own.width - 4, x - frame.left - own.width / 2)) + "px";
    caption.style.top = Math.max(4, y - frame.top - own.height - 12) + "px";
  }
  /* Show in the picture which room of the ranking is pointed at. */
  function hint(event) {
    const row = event.type === "pointerleave" ? null : event.target.closest(".rooms [data-key]");
    for (const room of svg.querySelectorAll(".room")) room.classList.toggle("hinted", row !== null && room.dataset.node === row.dataset.key);
  }
  function choose(event) {
    const group = event.target.closest && event.target.closest("[data-node]");
    change({ node: group ? Number(group.dataset.node) : 0 });
    const again = svg.querySelector(`[data-node="${look.node}"][tabindex]`);
    if (again && event.type === "keydown") again.focus();
  }

  function listen() {
    pick("view").addEventListener("change", (e) => change({ view: Number(e.target.value), node: 0 }));
    pick("class").addEventListener("change", (e) => change({ sought: Number(e.target.value) }));
    pick("threshold").addEventListener("input", (e) => hide(e.target.value / 100));
    pick("plan").addEventListener("click", () => change({ plan: true }));
    pick("layers").addEventListener("click", () => change({ plan: false }));
    svg.addEventListener("click", choose);
    svg.addEventListener("keydown", (e) => { if (e.key === "Enter" || e.key === " ") { e.preventDefault(); choose(e); } });
    for (const kind of ["pointermove", "pointerleave", "focusin", "focusout"]) svg.addEventListener(kind, tell);
    for (const kind of ["pointerover", "pointerleave", "focusin"]) side.addEventListener(kind, hint);
    document.addEventListener("keydown", (e) => { if (e.key === "Escape") change({ node: 0 }); });
    document.addEventListener("theme", () => { look.theme = Theme.choice(); Link.write(views, titles, look); });
    window.addEventListener("resize", paint);
    window.addEventListener("hashchange", open);
  }
  /* Show what the link says, and what it does not say as at the start. */
  function open() {
    const { theme = "", view = 0, ...said } = Link.read(views, titles);
    Object.assign(look, start(view));
    Theme.choose(theme);
    change({ view, ...said });
  }

  titles.forEach((title, value) => make("option", { value }, pick("view"), title));
  pick("view").parentElement.hidden = views.length < 2;
  listen();
  open();
})();
