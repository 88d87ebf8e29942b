/* The panel beside the picture: ranked rooms, likely classes, every class; and the legend below the picture. */
const Panel = (() => {
  "use strict";
  const { make } = Elements;
  const { ALL, amount, nodeName, percent, soughtName } = Beliefs;
  const FIRST = 10;  // rows of a ranking before it is folded

  /* Show a node; `go` gets the `{ node }` or `{ sought }` that the user chose. */
  function show(side, view, look, go) {
    side.replaceChildren();
    const { node, sought } = look;
    if (node) button(side, "back", "← the building", () => go({ node: 0 }));
    make("h2", {}, side, nodeName(view, node));
    if (node && sought !== ALL) placeOf(side, view, look);
    summarize(side, view, node);
    if (!node) rankRooms(side, view, sought, go);
    rankClasses(side, view, look, go);
    listClasses(side, view, look);
  }

  function button(parent, name, text, pressed) {
    const made = make("button", { class: name, type: "button" }, parent, text);
    made.addEventListener("click", pressed);
    return made;
  }
  /* Make a paragraph; words in arrays are bold. */
  function paragraph(side, ...words) {
    const line = make("p", {}, side);
    for (const word of words) Array.isArray(word) ? make("b", {}, line, word[0]) : line.append(word);
  }

  function summarize(side, view, node) {
    const of = Beliefs.numbers(view, node, ALL), room = node ? view.rooms[node - 1] : null;
    paragraph(side, [amount(of.seen)], " seen, ", [amount(of.more)], " more expected",
      ...(of.unseen === null ? ["."] : ["; true: ", [amount(of.unseen)], " more."]));
    const bare = view.classless[node];
    if (bare) paragraph(side, [amount(bare)], " seen without a class.");
    const share = room ? room.share : view.hidden_share;
    paragraph(side, room && !room.visited ? "Not visited yet. The expectation follows from the rest of the building and the kind of room, if it was given. Ids and labels are not read."
      : share === 0 ? "All of it was searched." : "About " + percent(share) + " of its objects are assumed to be unseen.");
    paragraph(side, "Expected by " + (view.model || "an unnamed model") + ".");
  }

  function placeOf(side, view, { node, sought }) {
    const place = Beliefs.rankRooms(view, sought).findIndex((of) => of.node === node) + 1;
    make("p", { class: "answer" }, side, `${Beliefs.sayLong(view, node, sought)}. Rank ${place} of ${view.rooms.length} rooms${view.left_out ? " shown" : ""}.`);
  }

  function rankRooms(side, view, sought, go) {
    make("h3", {}, side, sought === ALL ? "Rooms by expected unseen objects" : "Rooms by the probability of at least one unseen " + soughtName(view, sought));
    if (sought !== ALL) make("p", { class: "answer" }, side, "In the whole building: " + Beliefs.sayLong(view, 0, sought) + ".");
    const most = sought === ALL ? Beliefs.mostWorth(view, ALL) : 1;
    rank(side, "rooms", Beliefs.rankRooms(view, sought).map((of) => ({
      name: nodeName(view, of.node), words: Beliefs.sayShort(of, sought) + mark(of, sought),
      share: Beliefs.worth(of, sought) / most, key: of.node, chosen: () => go({ node: of.node }),
    })));
    if (view.truth && sought !== ALL) make("p", {}, side, "✓ the truth has an unseen one here, – it has none.");
  }
  const mark = (of, sought) => of.unseen === null || sought === ALL ? "" : of.unseen > 0 ? " ✓" : " –";

  function rankClasses(side, view, { node, sought }, go) {
    make("h3", {}, side, "Most likely classes not seen " + (node ? "here" : "anywhere"));
    const ranked = Beliefs.rankClasses(view, node, 6);
    if (!ranked.length) make("p", {}, side, "No unseen class is likely.");
    rank(side, "classes", ranked.map((of) => ({
      name: view.classes[of.class], words: Beliefs.sayShort(of, of.class) + mark(of, of.class), share: of.chance,
      key: of.class, picked: of.class === sought, chosen: () => go({ sought: of.class }),
    })));
    if (ranked.length && view.truth) make("p", {}, side, "✓ the truth has an unseen one here, – it has none.");
  }

  /* Make a list of buttons with words and a bar; rows after the first `FIRST` are folded. */
  function rank(side, kind, rows) {
    const list = (parent, some, start) => {
      const made = make("ol", { class: "rank " + kind, start }, parent);
      for (const { name, words, share, key, picked, chosen } of some) {
        const pressed = button(make("li", {}, made), picked ? "picked" : "", "", chosen);
        pressed.dataset.key = key;
        make("span", { class: "what" }, pressed, name);
        pressed.append(" ");
        make("span", { class: "much" }, pressed, words);
        make("span", { class: "more", style: { width: `${(100 * share).toFixed(1)}%` } }, make("span", { class: "bar" }, pressed));
      }
    };
    list(side, rows.slice(0, FIRST), 1);
    if (rows.length <= FIRST) return;
    const folded = make("details", {}, side);
    make("summary", {}, folded, `${rows.length - FIRST} more`);
    list(folded, rows.slice(FIRST), FIRST + 1);
  }

  function listClasses(side, view, { node, sought }) {
    const truth = view.truth && view.truth[node], expected = view.expected[node], seen = view.input[node];
    const rows = expected.map((x, c) => ({ class: c, most: Math.max(x, truth ? truth[c] : 0) }))
      .filter((row) => row.most > 0.05).sort((a, b) => b.most - a.most || a.class - b.class);
    make("h3", {}, side, "Every class");
    const key = make("div", { class: "key" }, side);
    for (const [name, text] of [["seen", "seen"], ["more", "more expected"], ...(truth ? [["true", "true count"]] : [])]) {
      const item = make("span", {}, key);
      make("i", { class: name }, item);
      item.append(text);
    }
    const table = make("table", { class: "histogram" }, side);
    const head = make("tr", {}, make("thead", {}, table)), body = make("tbody", {}, table);
    for (const text of ["class", "", "seen", "more expected", "at least one unseen", ...(truth ? ["truly unseen"] : [])])
      make(text ? "th" : "td", text ? { scope: "col" } : {}, head, text);
    const most = Math.max(1, ...expected, ...(truth || []));
    for (const { class: c } of rows) {
      const of = Beliefs.numbers(view, node, c);
      const row = make("tr", c === sought ? { class: "picked" } : {}, body);
      make("th", { scope: "row" }, row, view.classes[c]);
      const bar = make("div", { class: "bar" }, make("td", { class: "bars" }, row));
      make("div", { class: "seen", style: { width: `${100 * of.seen / most}%` } }, bar);
      make("div", { class: "more", style: { width: `${100 * of.more / most}%` } }, bar);
      if (truth) make("div", { class: "true", style: { left: `calc(${100 * truth[c] / most}% - 2px)` } }, bar);
      for (const text of [amount(of.seen), amount(of.more), percent(of.chance), ...(truth ? [amount(of.unseen)] : [])])
        make("td", {}, row, text);
    }
  }

  /* Write the legend of colours and shades. */
  function explain(box, view, look) {
    box.replaceChildren();
    const most = Beliefs.mostWorth(view, look.sought);
    const one = look.sought !== ALL, name = soughtName(view, look.sought);
    const entry = (kind, text) => { const item = make("span", {}, box); make("i", { class: kind }, item); item.append(text); };
    if (!look.plan) { entry("building", "building"); entry("room", "room"); }
    entry(one ? "sought" : "object", one ? "seen " + name : "seen object");
    if (!one && view.classless[0]) entry("classless", "seen, belongs to no class");
    entry("blind", "blind node: expected, not seen (faint: unsure)");
    const scale = make("span", {}, box, one ? `at least one unseen ${name}: 0 %` : "more expected: 0");
    make("span", { class: "scale" }, scale);
    scale.append(one ? percent(most) : amount(most));
    if (view.rooms.some((room) => !room.visited)) make("span", {}, box, "dashed: not visited");
  }
  return { show, explain };
})();
